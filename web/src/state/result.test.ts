import { expect, it } from "vitest";
import { figuresOf } from "./figures";
import { networkFromFile, warningsOf } from "./result";

const up = [0, 0, 1] as const;

it("joins the segments of a scanned curve and keeps the nodes' numbers", () => {
  const network = networkFromFile({
    points: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]],
    normals: [up, up, up, up, up],
    nodes: [0, 2],
    segments: [
      { points: [0, 1, 2], boundary: true, curve: 0 },
      { points: [2, 3, 0], boundary: true, curve: 0 },
      { points: [0, 4, 2], boundary: false, curve: 1 },
    ],
  });
  expect([...network.curves.values()].map(({ index, boundary, closed }) => [index, boundary, closed])).toEqual([
    [0, true, true],
    [1, false, false],
  ]);
  expect([...(network.curves.get(0)?.points.coordinates ?? [])]).toEqual([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 0]);
  expect(network.nodes.get(1)?.position).toEqual([1, 1, 0]);
});

it("gives the nodes the numbers that people marked", () => {
  const file = { points: [[0, 0, 0], [1, 0, 0]] as const, normals: [up, up], nodes: [0, 1], segments: [] };
  expect([...networkFromFile(file, [3, 8]).nodes.keys()]).toEqual([3, 8]);
});

it("draws a curve in pieces when its segments do not meet", () => {
  const network = networkFromFile({
    points: [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],
    normals: [up, up, up, up],
    nodes: [0, 1, 2, 3],
    segments: [
      { points: [0, 1], boundary: false, curve: 0 },
      { points: [2, 3], boundary: false, curve: 0 },
    ],
  });
  expect([...network.curves.values()].map((curve) => curve.points.count)).toEqual([2, 2]);
});

it("shows of a report what is there, and every warning", () => {
  const report = {
    seconds: 1.5,
    surface: { faces: 1200, warnings: ["thin"] },
    network: { warnings: ["long gap"], uncertainty: { mean_m: 0.0012 } },
  };
  expect(figuresOf(report)).toEqual([
    { label: "Uncertainty, mean", value: "1.20 mm" },
    { label: "Triangles", value: "1\u202f200" },
    { label: "Time", value: "1.50 s" },
  ]);
  expect(warningsOf(report)).toEqual(["long gap", "thin"]);
  expect(figuresOf({})).toEqual([]);
});
