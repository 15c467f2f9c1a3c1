import { describe, expect, it } from "vitest";
import { blend, boundingBox, ease, polylineLength, resample } from "./vectors";

const corner = [0, 0, 0, 3, 0, 0, 3, 4, 0];

describe("polylines", () => {
  it("have the length of their edges", () => {
    expect(polylineLength(corner)).toBe(7);
    expect(polylineLength([1, 2, 3])).toBe(0);
    expect(polylineLength([])).toBe(0);
  });

  it("keep their ends and lie on the old line when they are sampled anew", () => {
    expect([...resample(corner, 3)]).toEqual(corner);
    expect([...resample(corner, 5)]).toEqual([0, 0, 0, 1.5, 0, 0, 3, 0, 0, 3, 2, 0, 3, 4, 0]);
    expect([...resample([1, 2, 3], 2)]).toEqual([1, 2, 3, 1, 2, 3]);
    expect([...resample(corner, 1)]).toEqual([0, 0, 0]);
  });

  it("have a box, if they have points", () => {
    expect(boundingBox([corner, [-1, 5, 2]])).toEqual({ min: [-1, 0, 0], max: [3, 5, 2] });
    expect(boundingBox([[], []])).toBeUndefined();
  });
});

describe("transitions", () => {
  it("begin at the old points, end at the new ones, and let extra points stand", () => {
    const out = new Float32Array(6);
    blend([0, 0, 0], [2, 4, 6, 9, 9, 9], 0, out);
    expect([...out]).toEqual([0, 0, 0, 9, 9, 9]);
    blend([0, 0, 0], [2, 4, 6, 9, 9, 9], 0.5, out);
    expect([...out]).toEqual([1, 2, 3, 9, 9, 9]);
    blend([0, 0, 0], [2, 4, 6, 9, 9, 9], 1, out);
    expect([...out]).toEqual([2, 4, 6, 9, 9, 9]);
  });

  it("are eased symmetrically between 0 and 1", () => {
    expect([ease(-1), ease(0), ease(0.5), ease(1), ease(2)]).toEqual([0, 0, 0.5, 1, 1]);
    expect(ease(0.2) + ease(0.8)).toBeCloseTo(1, 12);
  });
});
