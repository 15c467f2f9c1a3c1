import { expect, it } from "vitest";
import { allSeen, fitInto, linePaths, seen } from "./axonometry";

it("shows up as up, East to the right, North away from the eye", () => {
  expect(seen(0, 0, 1)[0]).toBeCloseTo(0, 12);
  expect(seen(0, 0, 1)[1]).toBeLessThan(0);
  expect(seen(1, 0, 0)[0]).toBeGreaterThan(0.8);
  expect(seen(0, 1, 0)[1]).toBeLessThan(0);
});

it("brings everything into the picture, as large as it goes", () => {
  const points = allSeen([0, 0, 0, 1, 0, 0, 1, 2, 0.5, -0.3, 1, 2]);
  const fit = fitInto([points], 300, 200, 10);
  if (!fit) throw new Error("there are points");
  const xs = [0, 2, 4, 6].map((i) => fit.x + fit.scale * (points[i] ?? NaN));
  const ys = [1, 3, 5, 7].map((i) => fit.y + fit.scale * (points[i] ?? NaN));
  expect(Math.min(...xs)).toBeGreaterThanOrEqual(10 - 1e-9);
  expect(Math.max(...xs)).toBeLessThanOrEqual(290 + 1e-9);
  expect(Math.max(...ys) - Math.min(...ys)).toBeCloseTo(180, 9);
  expect(fitInto([[]], 300, 200, 10)).toBeUndefined();
});

it("draws lines inside the picture, one path each", () => {
  const paths = linePaths([[0, 0, 0, 1, 0, 0, 1, 1, 0], [0, 0, 0, 0, 0, 1], []], 96, 64, 5);
  const numbers = paths.join(" ").match(/-?[\d.]+/g)?.map(Number) ?? [];
  const [xs, ys] = [numbers.filter((_, i) => i % 2 === 0), numbers.filter((_, i) => i % 2 === 1)];
  expect(paths.map((path) => path.split("L").length)).toEqual([3, 2, 1]);
  expect([Math.min(...xs) >= 4.9, Math.max(...xs) <= 91.1, Math.min(...ys) >= 4.9, Math.max(...ys) <= 59.1]).not.toContain(false);
  expect(linePaths([], 96, 64, 5)).toEqual([]);
});
