import { Group } from "three";
import { symmetricRange } from "../geometry/colormaps";
import { curvatureVectors, norms } from "../geometry/curvature";
import { diagonal } from "../geometry/vectors";
import type { Network } from "../state/network";
import { HairsLayer } from "./hairs";
import type { UncertainLine } from "../state/result";
import type { Palette } from "./palette";
import { TubesLayer } from "./tubes";

const NORMAL_LENGTH = 0.04;
const SPIKE_LENGTH = 0.12;

export interface Normals {
  readonly positions: ArrayLike<number>;
  readonly normals: ArrayLike<number>;
}

/** What stands on the curves: their normals, spikes as long as their curvature, away from its centre, and tubes as wide as
 * they are uncertain. */
export class Decorations {
  readonly object = new Group();
  readonly #normals: HairsLayer;
  readonly #spikes: HairsLayer;
  readonly #tubes: TubesLayer;

  constructor(palette: Palette) {
    this.#normals = new HairsLayer(palette.accent);
    this.#spikes = new HairsLayer(palette.interior);
    this.#tubes = new TubesLayer(palette.accent);
    this.object.add(this.#normals.object, this.#spikes.object, this.#tubes.object);
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

  showTubes(lines: readonly UncertainLine[] | undefined, magnified: number): void {
    this.#tubes.clear();
    if (lines) this.#tubes.set(lines, magnified);
  }

  recolor(palette: Palette): void {
    this.#normals.recolor(palette.accent);
    this.#spikes.recolor(palette.interior);
    this.#tubes.recolor(palette.accent);
  }

  dispose(): void {
    this.#normals.dispose();
    this.#spikes.dispose();
    this.#tubes.dispose();
  }
}
