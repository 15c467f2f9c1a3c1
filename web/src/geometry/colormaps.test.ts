import { describe, expect, it } from "vitest";
import { colorAt, diverging, sample, type Stops, symmetricRange } from "./colormaps";

/** CIE lightness of an sRGB colour, 0..100. */
function lightness(rgb: readonly number[]): number {
  const linear = rgb.map((byte) => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4));
  const y = 0.2126 * (linear[0] ?? 0) + 0.7152 * (linear[1] ?? 0) + 0.0722 * (linear[2] ?? 0);
  return y > 0.008856 ? 116 * Math.cbrt(y) - 16 : 903.3 * y;
}

function lightnesses(stops: Stops, from: number, to: number): number[] {
  return Array.from({ length: 33 }, (_, i) => lightness(colorAt(stops, from + ((to - from) * i) / 32)));
}

const rises = (values: number[]): boolean => values.every((value, i) => i === 0 || value > (values[i - 1] ?? 0) - 1e-9);

describe("colour maps", () => {
  it("the diverging map is lightest at zero, darkens to both sides and treats them alike", () => {
    expect(rises(lightnesses(diverging, 0, 0.5))).toBe(true);
    expect(rises(lightnesses(diverging, 1, 0.5))).toBe(true);
    for (const t of [0, 0.125, 0.25]) {
      const difference = lightness(colorAt(diverging, t)) - lightness(colorAt(diverging, 1 - t));
      expect(Math.abs(difference)).toBeLessThan(8);
    }
  });

  it("are sampled from their first to their last stop", () => {
    const bytes = sample(["#000000", "#ff8000"], 3);
    expect([...bytes]).toEqual([0, 0, 0, 255, 128, 64, 0, 255, 255, 128, 0, 255]);
  });
});

describe("symmetricRange", () => {
  it("holds the share asked for and does not follow outliers", () => {
    const values = Array.from({ length: 200 }, (_, i) => (i % 2 ? -1 : 1) * (i / 200));
    expect(symmetricRange([...values, 1e6], 0.97)).toBeLessThan(1);
    expect(symmetricRange([0, 0])).toBe(1);
  });
});
