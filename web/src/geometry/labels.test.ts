import { describe, expect, it } from "vitest";
import { covers, overlap, placeLabels } from "./labels";

const size = { width: 24, height: 18 };

/** A small deterministic generator, so that a failure can be repeated. */
function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state * 1664525 + 1013904223) % 2 ** 32;
    return state / 2 ** 32;
  };
}

describe("placeLabels", () => {
  it("puts a lone label up and to the right of its anchor", () => {
    const [label] = placeLabels([{ id: 7, x: 100, y: 100 }], size);
    expect(label).toMatchObject({ id: 7, x: 100, y: 100 });
    expect(label?.labelX).toBeGreaterThan(100);
    expect(label?.labelY).toBeLessThan(100);
  });

  it.each([1, 2, 3, 4, 5])("never lets two labels overlap, however close their anchors (seed %i)", (seed) => {
    const next = random(seed);
    const anchors = Array.from({ length: 40 }, (_, id) => ({ id, x: 60 * next(), y: 60 * next() }));
    const labels = placeLabels(anchors, size);
    const pairs = labels.flatMap((a, i) => labels.slice(i + 1).map((b) => [a, b] as const));
    expect(pairs.filter(([a, b]) => overlap(a, b, size))).toEqual([]);
    expect(labels.filter((label) => anchors.some((anchor) => covers(label, anchor, size)))).toEqual([]);
    expect(labels.map((label) => label.id)).toEqual(anchors.map((anchor) => anchor.id));
  });

  it("leaves earlier labels where they were when one is added out of their way", () => {
    const anchors = [0, 1, 2].map((id) => ({ id, x: 80 * id, y: 60 * id }));
    expect(placeLabels(anchors, size).slice(0, 2)).toEqual(placeLabels(anchors.slice(0, 2), size));
  });
});
