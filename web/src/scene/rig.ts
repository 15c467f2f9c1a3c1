import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Box, Vector } from "../geometry/vectors";

const FIELD_OF_VIEW = 32;
const MARGIN = 1.06;
/** Half-life of the way that is left, s. */
const HALF_LIFE = 0.11;
const FIRST_DIRECTION = new Vector3(0.55, -1, 0.62).normalize();

/** Named directions from the object to the eye; keys 1 to 7 choose them. */
export const VIEWS: readonly { readonly name: string; readonly direction: readonly [number, number, number] }[] = [
  { name: "perspective", direction: [0.55, -1, 0.62] },
  { name: "front (from South)", direction: [0, -1, 0] },
  { name: "back (from North)", direction: [0, 1, 0] },
  { name: "left (from West)", direction: [-1, 0, 0] },
  { name: "right (from East)", direction: [1, 0, 0] },
  { name: "top", direction: [0, -1e-4, 1] },
  { name: "bottom", direction: [0, -1e-4, -1] },
];

interface Goal {
  readonly target: Vector3;
  readonly position: Vector3;
}

/** The camera and where it is going: it follows the object until a person takes hold of it. */
export class Rig {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.001, 100);
  readonly controls: OrbitControls;
  #goal: Goal | undefined;

  /** `grabbed` is called when a person moves the camera, `moved` whenever it moved. */
  constructor(element: HTMLElement, grabbed: () => void, moved: () => void) {
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(FIRST_DIRECTION).multiplyScalar(2);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("start", () => {
      this.#goal = undefined;
      grabbed();
    });
    this.controls.addEventListener("change", moved);
  }

  resize(width: number, height: number): void {
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
  }

  /** Bring the whole box into sight; from `direction`, or from where the eye is now. */
  frame(box: Box, direction: Vector3 = this.direction()): void {
    const [min, max] = [new Vector3(...box.min), new Vector3(...box.max)];
    const target = min.clone().add(max).multiplyScalar(0.5);
    const radius = Math.max(min.distanceTo(max) / 2, 1e-3);
    const distance = Math.max(MARGIN * this.#distanceFor(min, max, target, direction), 0.2 * radius);
    this.#goal = { target, position: target.clone().addScaledVector(direction, distance) };
    this.#clip(radius, distance);
  }

  /** Turn about and centre this point, from the same side and distance. */
  focus(point: Vector3): void {
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(0.6);
    this.#goal = { target: point.clone(), position: point.clone().add(offset) };
  }

  /** From the object to the eye, or to where the eye is going. */
  direction(): Vector3 {
    const { position, target } = this.#goal ?? { position: this.camera.position, target: this.controls.target };
    return position.clone().sub(target).normalize();
  }

  /** World axes x, y, z as the eye sees them: right, up and towards it, for each. */
  axes(): [Vector, Vector, Vector] {
    const turn = this.camera.quaternion.clone().invert();
    const seen = (x: number, y: number, z: number): Vector => new Vector3(x, y, z).applyQuaternion(turn).toArray();
    return [seen(1, 0, 0), seen(0, 1, 0), seen(0, 0, 1)];
  }

  /** Go on for `seconds`, or at once when they are infinite; true while there is way left. */
  step(seconds: number): boolean {
    if (!this.#goal) return false;
    const { target, position } = this.#goal;
    const share = 1 - 0.5 ** (seconds / HALF_LIFE);
    this.controls.target.lerp(target, share);
    this.camera.position.lerp(position, share);
    const left = this.camera.position.distanceTo(position) / position.distanceTo(target);
    if (left < 1e-3) this.#goal = undefined;
    this.controls.update();
    return left >= 1e-3;
  }

  /** Length at the target that one pixel shows, m. */
  metresPerPixel(height: number): number {
    const distance = this.camera.position.distanceTo(this.controls.target);
    return (2 * distance * Math.tan((FIELD_OF_VIEW * Math.PI) / 360)) / Math.max(height, 1);
  }

  dispose(): void {
    this.controls.dispose();
  }

  /** Least distance from which every corner of the box is inside the picture, m. */
  #distanceFor(min: Vector3, max: Vector3, target: Vector3, direction: Vector3): number {
    const right = new Vector3().crossVectors(this.camera.up, direction).normalize();
    const up = new Vector3().crossVectors(direction, right);
    const slope = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    let distance = 0;
    for (let corner = 0; corner < 8; corner += 1) {
      const pick = (bit: number, axis: "x" | "y" | "z"): number => (corner & bit ? max : min)[axis];
      const p = new Vector3(pick(1, "x"), pick(2, "y"), pick(4, "z")).sub(target);
      const needed = Math.max(Math.abs(p.dot(up)), Math.abs(p.dot(right)) / this.camera.aspect) / slope;
      distance = Math.max(distance, needed + p.dot(direction));
    }
    return distance;
  }

  #clip(radius: number, distance: number): void {
    this.camera.near = Math.max(radius, distance) / 500;
    this.camera.far = 60 * Math.max(radius, distance);
    this.camera.updateProjectionMatrix();
  }
}
