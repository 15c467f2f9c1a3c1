import { BufferAttribute, BufferGeometry, type Color, Group, Mesh, MeshBasicMaterial } from "three";
import { tube } from "../geometry/tubes";
import { roundDown } from "../geometry/units";
import { diagonal } from "../geometry/vectors";
import type { UncertainLine } from "../state/result";

const SIDES = 10;
/** Radius of the thickest tube when nothing is magnified beyond need, as part of the network's diagonal. */
const THICKEST = 0.03;
/** Standard uncertainties that a radius stands for: about 95 of 100 points are within. */
export const COVERAGE = 2;

/** How many times the tubes are drawn thicker than they are, so that they can be seen: 1, 2, 5, 10, ... */
export function magnification(lines: readonly UncertainLine[]): number {
  const most = Math.max(...lines.map((line) => Math.max(...line.uncertainty)));
  const radius = THICKEST * diagonal(lines.map((line) => line.positions));
  return most > 0 ? Math.max(1, roundDown(radius / (COVERAGE * most))) : 1;
}

/** Around every curve, a tube that holds where it truly runs in about 95 of 100 cases. */
export class TubesLayer {
  readonly object = new Group();
  readonly #material = new MeshBasicMaterial({ transparent: true, opacity: 0.3, depthWrite: false });

  constructor(color: Color) {
    this.recolor(color);
  }

  set(lines: readonly UncertainLine[], magnified: number): void {
    this.clear();
    for (const { positions, uncertainty } of lines) {
      const made = tube(positions, uncertainty.map((u) => COVERAGE * magnified * u), SIDES);
      const geometry = new BufferGeometry()
        .setAttribute("position", new BufferAttribute(made.positions, 3))
        .setIndex(new BufferAttribute(made.indices, 1));
      this.object.add(new Mesh(geometry, this.#material));
    }
  }

  clear(): void {
    for (const child of this.object.children) (child as Mesh).geometry.dispose();
    this.object.clear();
  }

  recolor(color: Color): void {
    this.#material.color.copy(color);
  }

  dispose(): void {
    this.clear();
    this.#material.dispose();
  }
}
