import { expect, it } from "vitest";
import { piecesOnSphere, turned } from "./sphere";
import type { Vector } from "./vectors";

/** Seen from the South: East to the right, up is up, South towards the eye. */
const fromSouth: readonly [Vector, Vector, Vector] = [
  [1, 0, 0],
  [0, 0, -1],
  [0, 1, 0],
];

it("turns a vector to where the eye sees it", () => {
  expect(turned([0, 0, 0, 0.6, -0.8, 0], 3, fromSouth)).toEqual([0.6, 0, 0.8]);
  expect(turned([0, 0, 1], 0, fromSouth)).toEqual([0, 1, 0]);
});

it("cuts a line at the sphere's outline and leaves no gap there", () => {
  const equator = Array.from({ length: 13 }, (_, i) => (i * Math.PI) / 6 + 0.1).flatMap((t) => [Math.cos(t), Math.sin(t), 0]);
  const pieces = piecesOnSphere(equator, fromSouth);
  expect(pieces.map((piece) => piece.front)).toEqual([false, true, false]);
  for (const [index, piece] of pieces.entries()) {
    expect(pieces[index + 1]?.places.slice(0, 2) ?? piece.places.slice(-2)).toEqual(piece.places.slice(-2));
  }
  expect(piecesOnSphere([], fromSouth)).toEqual([]);
});
