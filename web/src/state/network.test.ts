import { describe, expect, it } from "vitest";
import { boundingBox } from "../geometry/vectors";
import type { ToBrowser } from "../protocol/messages";
import { type DrawnCurve, Network, Points, stretchOf } from "./network";

const start = (index: number, boundary = false): ToBrowser => ({ type: "live.curve.start", index, boundary });
const points = (index: number, first: number, positions: number[]): ToBrowser => ({
  type: "live.points",
  index,
  first,
  positions,
  samples: [],
});

describe("Points", () => {
  it("grow as a plain list does", () => {
    const growing = new Points();
    const plain: number[] = [];
    for (let i = 0; i < 500; i += 1) {
      const block = [i, 2 * i, 3 * i, i + 0.5, 0, 1];
      expect(growing.splice(plain.length / 3, block)).toBe(true);
      plain.push(...block);
    }
    expect(growing.count).toBe(1000);
    expect([...growing.coordinates]).toEqual(plain);
  });

  it("know the smallest box around them, whatever was added or overwritten", () => {
    const growing = new Points();
    expect(growing.box).toBeUndefined();
    for (let i = 0; i < 300; i += 1) {
      const first = i % 7 ? growing.count : Math.floor(growing.count / 2);
      growing.splice(first, [Math.sin(i) * i, Math.cos(3 * i), -i % 11, i % 5, i % 3, Math.sin(2 * i)]);
      if (i % 3) expect(growing.box).toEqual(boundingBox([growing.coordinates]));
    }
  });

  it("are overwritten from a point on, and refuse to leave a gap", () => {
    const growing = new Points([0, 0, 0, 1, 1, 1, 2, 2, 2]);
    expect(growing.splice(1, [9, 9, 9])).toBe(true);
    expect([...growing.coordinates]).toEqual([0, 0, 0, 9, 9, 9]);
    expect(growing.splice(3, [5, 5, 5])).toBe(false);
    expect(growing.count).toBe(2);
  });
});

describe("Network", () => {
  it("draws a curve as it is scanned", () => {
    const network = new Network();
    expect(network.apply(start(0, true))).toBe("grown");
    network.apply(points(0, 0, [0, 0, 0, 1, 0, 0]));
    network.apply(points(0, 2, [1, 1, 0]));
    network.apply({ type: "live.node", index: 0, node: { node: 4, position: [1, 0, 0] } });
    network.apply({ type: "live.curve.end", index: 0, closed: true });
    const curve = network.curves.get(0);
    expect(curve).toMatchObject({ boundary: true, closed: true, ended: true });
    expect([...(curve?.points.coordinates ?? [])]).toEqual([0, 0, 0, 1, 0, 0, 1, 1, 0]);
    expect(network.nodes.get(4)?.position).toEqual([1, 0, 0]);
  });

  it("asks for a fresh snapshot when points are missing or their curve is unknown", () => {
    const network = new Network();
    network.apply(start(0));
    expect(network.apply(points(0, 1, [0, 0, 0]))).toBe("gap");
    expect(network.apply(points(5, 0, [0, 0, 0]))).toBe("gap");
    expect(network.apply({ type: "live.curve.end", index: 5, closed: false })).toBe("gap");
  });

  it("is replaced as a whole after it was solved again", () => {
    const network = new Network();
    network.apply(start(0));
    network.apply(start(1));
    const solved = { index: 1, boundary: true, closed: false, ended: true, positions: [1, 2, 3], samples: [4] };
    const nodes = [{ node: 0, position: [1, 2, 3] as [number, number, number] }];
    expect(network.apply({ type: "live.network", curves: [solved], nodes })).toBe("replaced");
    expect([...network.curves.keys()]).toEqual([1]);
    expect([...network.nodes.keys()]).toEqual([0]);
    expect(network.apply(points(1, 1, [4, 5, 6]))).toBe("grown");
  });
});

it("finds the stretch of a curve between two samples, also over its end", () => {
  const positions = [0, 1, 2, 3, 4].flatMap((x) => [x, 0, 0]);
  const curve = { points: new Points(positions, [30, 40, 0, 10, 20]) } as DrawnCurve;
  const xs = (samples: [number, number] | null): number[] => stretchOf(curve, samples).filter((_, i) => i % 3 === 0);
  expect([xs([10, 30]), xs([35, 5]), xs([20, 20]), xs(null)]).toEqual([[0, 3, 4], [1, 2], [4], [0, 1, 2, 3, 4]]);
  expect(stretchOf({ points: new Points([1, 2, 3]) } as DrawnCurve, [0, 9])).toEqual([1, 2, 3]);
});
