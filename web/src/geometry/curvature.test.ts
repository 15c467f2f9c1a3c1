import { describe, expect, it } from "vitest";
import { arcLengths, curvatureVectors, norms } from "./curvature";

/** Points on a circle of radius r about c in a tilted plane; unevenly spaced. */
function circlePoints(r: number, c: readonly number[], angles: readonly number[]): number[] {
  const [u, v] = [[0.6, 0.8, 0], [0, 0, 1]] as const;
  return angles.flatMap((t) => [0, 1, 2].map((k) => (c[k] ?? 0) + r * (Math.cos(t) * (u[k] ?? 0) + Math.sin(t) * (v[k] ?? 0))));
}

describe("curvatureVectors", () => {
  const angles = [0, 0.3, 0.5, 1.1, 1.9, 2.2, 3.4, 4.4, 5.3];

  it("are exact on a circle: length 1/r, towards the centre", () => {
    const [r, centre] = [0.25, [1, -2, 3]] as const;
    const points = circlePoints(r, centre, [...angles, 2 * Math.PI]);
    const vectors = curvatureVectors(points, true);
    for (let i = 0; i < points.length; i += 1) {
      const wanted = ((centre[i % 3] ?? 0) - (points[i] ?? 0)) / r ** 2;
      expect(vectors[i]).toBeCloseTo(wanted, 9);
    }
  });

  it("vanish on a line and on anything shorter than three points", () => {
    expect([...curvatureVectors([0, 0, 0, 1, 1, 1, 3, 3, 3], false)].map(Math.abs)).toEqual(Array(9).fill(0));
    expect([...curvatureVectors([0, 0, 0, 1, 1, 1], false)]).toEqual(Array(6).fill(0));
  });

  it("survive a repeated point", () => {
    const vectors = curvatureVectors([0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 1, 0], false);
    expect(vectors.every(Number.isFinite)).toBe(true);
  });

  it("at the ends of an open curve are their neighbours'", () => {
    const sizes = norms(curvatureVectors(circlePoints(0.5, [0, 0, 0], angles), false));
    expect([...sizes].every((size) => Math.abs(size - 2) < 1e-9)).toBe(true);
  });
});

it("arc lengths add up the edges", () => {
  expect([...arcLengths([0, 0, 0, 3, 4, 0, 3, 4, 12])]).toEqual([0, 5, 17]);
});
