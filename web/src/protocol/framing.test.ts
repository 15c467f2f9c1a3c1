import { expect, it } from "vitest";
import { decodeFrame } from "./framing";
import vectors from "./framing.vectors.json";

it.each(vectors)("reads $hex as the bridge does", ({ hex, frame }) => {
  const bytes = Uint8Array.from(hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
  expect(decodeFrame(bytes) ?? null).toEqual(frame);
});
