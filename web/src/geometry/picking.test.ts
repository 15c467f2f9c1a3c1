import { expect, it } from "vitest";
import { nearestOnLines, nearestPlace } from "./picking";

it("finds the nearest line and its nearer point, between points too", () => {
  const lines = [
    [0, 0, 100, 0],
    [0, 50, 100, 50, 200, 50],
  ];
  expect(nearestOnLines(lines, 30, 10)).toEqual({ line: 0, point: 0, distance: 10 });
  expect(nearestOnLines(lines, 160, 46)).toEqual({ line: 1, point: 2, distance: 4 });
  expect(nearestOnLines(lines, 300, 50)).toEqual({ line: 1, point: 2, distance: 100 });
});

it("sees nothing behind the eye and nothing in nothing", () => {
  expect(nearestOnLines([[NaN, NaN, 10, 10]], 0, 0)).toBeUndefined();
  expect(nearestOnLines([], 0, 0)).toBeUndefined();
  expect(nearestOnLines([[NaN, NaN, 10, 10, 20, 10]], 12, 13)).toEqual({ line: 0, point: 1, distance: 3 });
});

it("finds the nearest place within reach", () => {
  const places = [0, 0, 10, 0, NaN, NaN];
  expect(nearestPlace(places, 7, 0, 5)).toBe(1);
  expect(nearestPlace(places, 50, 0, 5)).toBeUndefined();
});
