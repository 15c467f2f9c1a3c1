import { Raycaster, Scene, Vector2, Vector3, WebGLRenderer } from "three";
import { boundingBox, type Box, type Vector } from "../geometry/vectors";
import { roundDown } from "../geometry/units";
import type { Field } from "../state/fields";
import type { Network } from "../state/network";
import type { OverlayContent, Place } from "../state/overlay";
import { CurvesLayer } from "./curves";
import { Decorations } from "./decorations";
import type { LoadedSurface } from "./glb";
import { Ground } from "./ground";
import { lookNamed, type LookName } from "./looks";
import type { Palette } from "./palette";
import { drawOverlay, type Inks } from "./picture";
import { Rig, VIEWS } from "./rig";
import { SurfaceLayer } from "./surface";

const TRANSITION_SECONDS = 0.2;
const GRID_LINES = 8;

export interface ViewportEvents {
  /** A frame was drawn: overlays follow now. */
  drawn(): void;
  /** A person took the camera. */
  grabbed(): void;
}

/** The 3D view: draws when something changed, and only then. */
export class Viewport {
  readonly rig: Rig;
  readonly decorations: Decorations;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #curves: CurvesLayer;
  readonly #ground: Ground;
  readonly #resizer: ResizeObserver;
  #surface: SurfaceLayer | undefined;
  #box: Box | undefined;
  /** What a moving network was in so far. */
  #swept: Box | undefined;
  /** Whether everything was brought into sight and nobody took the camera since. */
  #framed = false;
  #frame = 0;
  #last = 0;
  #fade = 1;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private palette: Palette,
    private readonly still: boolean,
    private readonly events: ViewportEvents,
  ) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: true });
    this.#renderer.setPixelRatio(pixelRatio());
    this.rig = new Rig(canvas, () => this.#grab(), () => this.invalidate());
    this.#curves = new CurvesLayer(palette);
    this.#ground = new Ground(palette.grid);
    this.decorations = new Decorations(palette);
    this.#scene.add(this.#ground.object, this.#curves.object, this.decorations.object);
    this.#scene.background = palette.background;
    this.#resizer = new ResizeObserver(() => this.#resize());
    this.#resizer.observe(canvas);
    this.#resize();
  }

  /** Take over what the network shows now; `replaced`: its points may lie elsewhere than before; `moving`: and will do so
   * again at once, so that the view stays where it is as long as everything fits in. */
  showNetwork(network: Network, replaced: boolean, follow: boolean, moving: boolean): void {
    if (replaced) this.#curves.replace(network, !this.still && !moving);
    else this.#curves.grow(network);
    this.#measure(network, moving ? this.#swept : undefined);
    this.#swept = moving ? this.#box : undefined;
    if (follow) this.fit();
    this.invalidate();
  }

  showSurface(loaded: LoadedSurface | undefined, look: LookName): void {
    if (this.#surface) {
      this.#scene.remove(this.#surface.object);
      this.#surface.dispose();
      this.#surface = undefined;
    }
    if (loaded) {
      this.#surface = new SurfaceLayer(loaded.geometry, this.palette, look);
      this.#scene.add(this.#surface.object);
      this.#fade = this.still ? 1 : 0;
      this.#surface.opacity = this.#fade;
    }
    this.invalidate();
  }

  /** Look at the surface in this way; `field`: the values that the look shows, if it shows any. */
  setLook(look: LookName, field: Field | undefined): void {
    if (this.#surface) {
      this.#surface.look = look;
      this.#surface.field = field;
    }
    this.#curves.neutralize(this.#surface !== undefined && lookNamed(look).colored);
    this.invalidate();
  }

  setVisible(parts: { curves: boolean; surface: boolean; grid: boolean }): void {
    this.#curves.object.visible = parts.curves;
    this.#ground.object.visible = parts.grid;
    if (this.#surface) this.#surface.object.visible = parts.surface;
    this.invalidate();
  }

  highlight(curve: number | undefined): void {
    this.#curves.highlight(curve);
    this.invalidate();
  }

  recolor(palette: Palette): void {
    this.palette = palette;
    this.#scene.background = palette.background;
    this.#curves.recolor(palette);
    this.#ground.recolor(palette.grid);
    this.decorations.recolor(palette);
    this.#surface?.recolor(palette);
    this.invalidate();
  }

  /** Bring everything into sight; from the n-th named view, or from where the eye is. */
  fit(view?: number): void {
    const named = view === undefined ? undefined : VIEWS[view];
    this.#framed = true;
    if (this.#box) this.rig.frame(this.#box, named && new Vector3(...named.direction).normalize());
    this.invalidate();
  }

  /** Turn about the point of the surface under the pointer, if there is one. */
  focusAt(x: number, y: number): void {
    const point = this.pick(x, y);
    if (point) this.rig.focus(new Vector3(...point));
    this.#framed &&= !point;
    this.invalidate();
  }

  /** Point of the surface at a place of the view (CSS px from its top left corner), m. */
  pick(x: number, y: number): Vector | undefined {
    if (!this.#surface) return undefined;
    const caster = new Raycaster();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    caster.setFromCamera(new Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.rig.camera);
    return caster.intersectObject(this.#surface.object)[0]?.point.toArray();
  }

  /** Where a point (m) is on the screen, CSS px; undefined behind the eye. */
  project(point: ArrayLike<number>): Place | undefined {
    const v = new Vector3(point[0], point[1], point[2]).project(this.rig.camera);
    if (v.z > 1) return undefined;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return { x: ((v.x + 1) / 2) * width, y: ((1 - v.y) / 2) * height };
  }

  tips(): Float32Array[] {
    return this.#curves.tips();
  }

  /** Length at the centre of attention that one CSS px shows, m; 0 while there is nothing to see. */
  get metresPerPixel(): number {
    if (!this.#box) return 0;
    return this.rig.metresPerPixel(this.canvas.clientHeight);
  }

  /** A PNG of the view with its labels, `scale` pixels to each CSS px. */
  async picture(scale: number, overlay: OverlayContent, inks: Inks): Promise<Blob> {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const sheet = new OffscreenCanvas(width * scale, height * scale);
    const context = sheet.getContext("2d");
    if (!context) throw new Error("This browser cannot make pictures.");
    this.#renderer.setPixelRatio(scale);
    this.#renderer.render(this.#scene, this.rig.camera);
    context.drawImage(this.canvas, 0, 0);
    context.scale(scale, scale);
    drawOverlay(context, overlay, inks);
    this.#renderer.setPixelRatio(pixelRatio());
    this.invalidate();
    return sheet.convertToBlob({ type: "image/png" });
  }

  /** Ask for one more frame. */
  invalidate(): void {
    if (this.#frame) return;
    this.#frame = requestAnimationFrame((now) => this.#draw(now));
  }

  dispose(): void {
    cancelAnimationFrame(this.#frame);
    this.#resizer.disconnect();
    this.rig.dispose();
    this.#curves.dispose();
    this.#ground.dispose();
    this.decorations.dispose();
    this.#surface?.dispose();
    this.#renderer.dispose();
  }

  #draw(now: number): void {
    const seconds = Math.min((now - this.#last) / 1000, 0.05);
    this.#last = now;
    const moving = this.#step(seconds);
    this.#frame = 0; // not before: what the step itself moved is in this frame
    this.#renderer.render(this.#scene, this.rig.camera);
    this.events.drawn();
    if (moving) this.invalidate();
  }

  #step(seconds: number): boolean {
    const morphing = this.#curves.step(seconds / TRANSITION_SECONDS);
    const travelling = this.rig.step(this.still ? Infinity : seconds);
    const fading = this.#fade < 1;
    if (fading && this.#surface) {
      this.#fade = Math.min(this.#fade + seconds / TRANSITION_SECONDS, 1);
      this.#surface.opacity = this.#fade;
    }
    return morphing || travelling || fading;
  }

  #measure(network: Network, swept: Box | undefined): void {
    const boxes = [...[...network.curves.values()].map((curve) => curve.points.box), swept];
    this.#box = boundingBox(boxes.flatMap((box) => (box ? [box.min, box.max] : [])));
    if (!this.#box) return;
    const { min, max } = this.#box;
    const size = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]);
    const centre = new Vector3((min[0] + max[0]) / 2, (min[1] + max[1]) / 2, min[2]);
    this.#ground.place(centre, roundDown(Math.max(size, 1e-3) / GRID_LINES), 1.1 * Math.max(size, 1e-3));
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (this.#renderer.getSize(new Vector2()).equals({ x: width, y: height })) return;
    this.#renderer.setSize(width, height, false);
    this.rig.resize(width, height);
    if (this.#framed) this.fit();
    this.invalidate();
  }

  #grab(): void {
    this.#framed = false;
    this.events.grabbed();
  }
}

function pixelRatio(): number {
  return Math.min(devicePixelRatio, 2);
}
