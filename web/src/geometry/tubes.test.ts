import { describe, expect, it } from "vitest";
import { cross, difference, dot, vectorAt } from "./algebra";
import { tube } from "./tubes";

const helix = Float32Array.from({ length: 60 }, (_, i) => {
  const t = Math.floor(i / 3) / 5;
  return [Math.cos(t), Math.sin(t), 0.3 * t][i % 3] as number;
});
const radii = Float32Array.from({ length: 20 }, (_, i) => 0.01 + 0.002 * i);

describe("tube", () => {
  const made = tube(helix, radii, 8);

  it("keeps every ring at its radius around its point", () => {
    for (let i = 0; i < 20; i += 1) {
      for (let k = 0; k < 8; k += 1) {
        const arm = difference(vectorAt(made.positions, 8 * i + k), vectorAt(helix, i));
        expect(Math.hypot(...arm)).toBeCloseTo(radii[i] as number, 5);
      }
    }
  });

  it("turns every triangle outwards", () => {
    for (let t = 0; t < made.indices.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => vectorAt(made.positions, made.indices[t + k] as number));
      if (!a || !b || !c) throw new Error("a triangle lacks a corner");
      const facing = cross(difference(b, a), difference(c, a));
      expect(dot(facing, vectorAt(made.normals, made.indices[t] as number))).toBeGreaterThan(0);
    }
  });

  it("does not twist on a straight line, and survives points that coincide", () => {
    const straight = tube([0, 0, 0, 1, 0, 0, 1, 0, 0, 2, 0, 0], [1, 1, 1, 1], 4);
    expect(straight.normals.slice(0, 12)).toEqual(straight.normals.slice(36, 48));
    expect(straight.positions.every(Number.isFinite)).toBe(true);
    expect(tube([], [], 6).indices.length).toBe(0);
  });
});
