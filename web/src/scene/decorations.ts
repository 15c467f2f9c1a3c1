import { Group } from "three";
import { symmetricRange } from "../geometry/colormaps";
import { curvatureVectors, norms } from "../geometry/curvature";
import { boundingBox } from "../geometry/vectors";
import type { Network } from "../state/network";
import { HairsLayer } from "./hairs";
import type { Palette } from "./palette";

const NORMAL_LENGTH = 0.04;
const SPIKE_LENGTH = 0.12;

export interface Normals {
  readonly positions: ArrayLike<number>;
  readonly normals: ArrayLike<number>;
}

/** What stands on the curves: their normals, and spikes as long as their curvature, away from its centre. */
export class Decorations {
  readonly object = new Group();
  readonly #normals: HairsLayer;
  readonly #spikes: HairsLayer;

  constructor(palette: Palette) {
    this.#normals = new HairsLayer(palette.accent);
    this.#spikes = new HairsLayer(palette.interior);
    this.object.add(this.#normals.object, this.#spikes.object);
  }

  showNormals(normals: Normals | undefined): void {
    this.#normals.clear();
    if (normals) this.#normals.set(normals.positions, normals.normals, NORMAL_LENGTH * diagonal([normals.positions]));
  }

  showSpikes(network: Network | undefined): void {
    this.#spikes.clear();
    if (!network) return;
    const curves = [...network.curves.values()];
    const points = curves.flatMap((curve) => [...curve.points.coordinates]);
    const vectors = curves.flatMap((curve) => [...curvatureVectors(curve.points.coordinates, curve.closed)]);
    if (points.length) this.#spikes.set(points, vectors, (-SPIKE_LENGTH * diagonal([points])) / symmetricRange(norms(vectors)));
  }

  recolor(palette: Palette): void {
    this.#normals.recolor(palette.accent);
    this.#spikes.recolor(palette.interior);
  }

  dispose(): void {
    this.#normals.dispose();
    this.#spikes.dispose();
  }
}

function diagonal(lists: Iterable<ArrayLike<number>>): number {
  const box = boundingBox(lists);
  return box ? Math.hypot(...box.max.map((value, axis) => value - (box.min[axis] ?? 0))) : 1;
}
