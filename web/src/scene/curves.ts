import { Group } from "three";
import { blend, ease, resample } from "../geometry/vectors";
import type { DrawnCurve, Network } from "../state/network";
import type { Palette } from "./palette";
import { Polyline } from "./polyline";

const BOUNDARY_WIDTH = 5;
const INTERIOR_WIDTH = 2.5;
const HIGHLIGHT_EXTRA = 2.5;
const DIMMED = 0.35;

interface Shown {
  readonly line: Polyline;
  /** What is on the screen, which lags behind the truth while a transition runs. */
  positions: Float32Array;
  from: Float32Array | undefined;
  curve: DrawnCurve;
}

/** The curves of a network as wide lines: the boundary is twice as wide as the interior and has its own colour. */
export class CurvesLayer {
  readonly object = new Group();
  readonly #shown = new Map<number, Shown>();
  #progress = 1;
  #neutral = false;
  #highlighted: number | undefined;

  constructor(private palette: Palette) {}

  /** Follow the network after points were added at the ends of its curves. */
  grow(network: Network): void {
    this.#match(network);
    for (const shown of this.#shown.values()) this.#extend(shown);
  }

  /** Go over to a network whose points lie elsewhere; `animated`: by and by, through `step`. */
  replace(network: Network, animated: boolean): void {
    const before = new Map([...this.#shown].map(([index, shown]) => [index, shown.positions]));
    this.#match(network);
    for (const [index, shown] of this.#shown) {
      const old = before.get(index);
      const count = shown.curve.points.count;
      shown.from = animated && old && old.length > 3 ? resample(old, count) : undefined;
      shown.positions = (shown.from ?? shown.curve.points.coordinates).slice();
      shown.line.set(shown.positions);
    }
    this.#progress = animated ? 0 : 1;
  }

  /** Advance the transition by a share of its whole; true while it goes on. */
  step(share: number): boolean {
    if (this.#progress >= 1) return false;
    this.#progress = Math.min(this.#progress + share, 1);
    for (const shown of this.#shown.values()) this.#move(shown);
    return this.#progress < 1;
  }

  /** Without a colour of their own, for surfaces whose colours mean something. */
  neutralize(neutral: boolean): void {
    this.#neutral = neutral;
    this.recolor(this.palette);
  }

  highlight(index: number | undefined): void {
    this.#highlighted = index;
    this.recolor(this.palette);
  }

  recolor(palette: Palette): void {
    this.palette = palette;
    for (const shown of this.#shown.values()) this.#style(shown);
  }

  /** The last point of every curve that is being scanned, as it is on the screen. */
  tips(): Float32Array[] {
    const growing = [...this.#shown.values()].filter((s) => !s.curve.ended && s.positions.length > 0);
    return growing.map((s) => s.positions.subarray(s.positions.length - 3));
  }

  dispose(): void {
    for (const shown of this.#shown.values()) shown.line.dispose();
  }

  #match(network: Network): void {
    for (const [index, shown] of this.#shown) {
      if (!network.curves.has(index)) this.#remove(index, shown);
    }
    for (const [index, curve] of network.curves) {
      const shown = this.#shown.get(index) ?? this.#add(index, curve);
      if (shown.curve !== curve) shown.positions = new Float32Array();
      shown.curve = curve;
      this.#style(shown);
    }
  }

  #add(index: number, curve: DrawnCurve): Shown {
    const shown = { line: new Polyline(), positions: new Float32Array(), from: undefined, curve };
    this.object.add(shown.line.object);
    this.#shown.set(index, shown);
    return shown;
  }

  #remove(index: number, shown: Shown): void {
    this.object.remove(shown.line.object);
    shown.line.dispose();
    this.#shown.delete(index);
  }

  #extend(shown: Shown): void {
    const target = shown.curve.points.coordinates;
    if (target.length === shown.positions.length) return;
    const first = Math.floor(Math.min(shown.positions.length, target.length) / 3);
    shown.positions = withTail(shown.positions, target, this.#progress < 1);
    shown.line.set(shown.positions, this.#progress < 1 ? 0 : first);
  }

  #move(shown: Shown): void {
    if (!shown.from) return;
    blend(shown.from, shown.curve.points.coordinates, ease(this.#progress), shown.positions);
    shown.line.set(shown.positions);
    if (this.#progress >= 1) shown.from = undefined;
  }

  #style(shown: Shown): void {
    const { boundary, index } = shown.curve;
    const chosen = this.#highlighted === index;
    const width = (boundary ? BOUNDARY_WIDTH : INTERIOR_WIDTH) + (chosen ? HIGHLIGHT_EXTRA : 0);
    const color = boundary || this.#neutral ? this.palette.boundary : this.palette.interior;
    shown.line.style(width, color, this.#highlighted === undefined || chosen ? 1 : DIMMED);
  }
}

/** The points on the screen, lengthened (or cut) to the truth's length; while moving, the old ones stay where they are.
 * At rest these are the truth's own: no copy of a long curve for every few points. */
function withTail(shown: Float32Array, target: Float32Array, moving: boolean): Float32Array {
  if (!moving) return target;
  const result = target.slice();
  result.set(shown.subarray(0, Math.min(shown.length, target.length)));
  return result;
}
