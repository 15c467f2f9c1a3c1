import type { LiveCurve, NodePosition } from "../wire.gen";
import { type Box, boundingBox } from "../geometry/vectors";
import type { ToBrowser } from "../protocol/messages";

/** How much larger full memory becomes. */
const GROWTH = 1.25;

/** Points that grow at the end: [x0, y0, z0, x1, ...] in m, world (ENU, z up). */
export class Points {
  #data: Float32Array;
  #length = 0;
  #samples: number[];
  #box: Box | undefined;
  /** Coordinates that the box knows. */
  #boxed = 0;

  /** `samples`: for each point the sample of its curve that it is at; empty where that is not known. */
  constructor(positions: ArrayLike<number> = [], samples: readonly number[] = []) {
    this.#data = Float32Array.from(positions);
    this.#length = positions.length;
    this.#samples = [...samples];
  }

  /** Number of points. */
  get count(): number {
    return this.#length / 3;
  }

  /** The coordinates; valid until the next change. */
  get coordinates(): Float32Array {
    return this.#data.subarray(0, this.#length);
  }

  /** The sample of its curve that each point is at; empty where that is not known. */
  get samples(): readonly number[] {
    return this.#samples;
  }

  /** The smallest box around all points, none without points; only what was added since the last call is looked at. */
  get box(): Box | undefined {
    if (this.#boxed < this.#length) {
      const added = this.#data.subarray(this.#boxed, this.#length);
      this.#box = boundingBox(this.#box ? [this.#box.min, this.#box.max, added] : [added]);
      this.#boxed = this.#length;
    }
    return this.#box;
  }

  /** Replace everything from point `first` on; false when points before `first` are missing. */
  splice(first: number, positions: ArrayLike<number>, samples: readonly number[] = []): boolean {
    if (first > this.count) return false;
    if (3 * first < this.#boxed) [this.#box, this.#boxed] = [undefined, 0];
    this.#samples.length = Math.min(first, this.#samples.length);
    for (const sample of samples) this.#samples.push(sample);
    const length = 3 * first + positions.length;
    if (length > this.#data.length) this.#grow(length);
    this.#data.set(positions, 3 * first);
    this.#length = length;
    return true;
  }

  #grow(length: number): void {
    const larger = new Float32Array(Math.max(length, Math.ceil(GROWTH * this.#data.length)));
    larger.set(this.coordinates);
    this.#data = larger;
  }
}

export interface DrawnCurve {
  readonly index: number;
  boundary: boolean;
  closed: boolean;
  ended: boolean;
  readonly points: Points;
}

export interface DrawnNode {
  readonly node: number;
  readonly position: readonly [number, number, number];
}

/** What a message did to the network as drawn. */
export type Change = "none" | "grown" | "replaced" | "gap";

/** The curves and nodes of a session as they are drawn: a plain fold over the live messages. */
export class Network {
  readonly curves = new Map<number, DrawnCurve>();
  readonly nodes = new Map<number, DrawnNode>();

  /** Fold one message in; "gap" means that points are missing and a fresh snapshot is needed. */
  apply(message: ToBrowser): Change {
    switch (message.type) {
      case "live.snapshot":
      case "live.network":
        return this.#replace(message.curves, message.nodes);
      case "live.curve.start":
        return this.#set({ ...message, closed: false, ended: false, positions: [], samples: [] });
      case "live.points":
        return this.curves.get(message.index)?.points.splice(message.first, message.positions, message.samples) ? "grown" : "gap";
      case "live.curve.end":
        return this.#end(message.index, message.closed);
      case "live.node":
        this.nodes.set(message.node.node, message.node);
        return "grown";
      default:
        return "none";
    }
  }

  #replace(curves: readonly LiveCurve[], nodes: readonly NodePosition[]): Change {
    this.curves.clear();
    this.nodes.clear();
    for (const curve of curves) this.#set(curve);
    for (const node of nodes) this.nodes.set(node.node, node);
    return "replaced";
  }

  #set(curve: LiveCurve): Change {
    const { index, boundary, closed, ended, positions, samples } = curve;
    this.curves.set(index, { index, boundary, closed, ended, points: new Points(positions, samples) });
    return "grown";
  }

  #end(index: number, closed: boolean): Change {
    const curve = this.curves.get(index);
    if (!curve) return "gap";
    curve.closed = closed;
    curve.ended = true;
    return "grown";
  }
}

/** Points [x0, y0, z0, x1, ...] of a curve from one of its samples to another; over its end where it is closed; all of
 * them unless samples are named or known. */
export function stretchOf(curve: DrawnCurve, samples: readonly [number, number] | null): number[] {
  const { coordinates, samples: known } = curve.points;
  if (!samples || !known.length) return [...coordinates];
  const [first, last] = samples;
  const inside = (at: number): boolean => (first <= last ? at >= first && at <= last : at >= first || at <= last);
  return known.flatMap((at, i) => (inside(at) ? [...coordinates.subarray(3 * i, 3 * i + 3)] : []));
}

/** The numbers of several lists, each once, in rising order. */
export function mergedNumbers(...lists: readonly Iterable<number>[]): number[] {
  return [...new Set(lists.flatMap((list) => [...list]))].sort((a, b) => a - b);
}
