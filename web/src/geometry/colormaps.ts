/** Colour maps as a few sRGB stops, evenly spaced, interpolated between them. */

export type Stops = readonly string[];

/** For signed values, also with colour-blind eyes: ColorBrewer's blue to white to orange (PuOr turned to blue). */
export const diverging: Stops = [
  "#08437f", "#2c7bb6", "#77b2d8", "#b7d7ea", "#f3f1ec", "#f7d0a8", "#eb9f5b", "#cd6a1d", "#8a3d08",
];

/** `count` colours as [r, g, b, 255, ...] bytes, sRGB. */
export function sample(stops: Stops, count: number): Uint8Array {
  const bytes = new Uint8Array(4 * count);
  for (let i = 0; i < count; i += 1) {
    const [r, g, b] = colorAt(stops, count > 1 ? i / (count - 1) : 0);
    bytes.set([r, g, b, 255], 4 * i);
  }
  return bytes;
}

/** Colour at t in 0..1 as [r, g, b] bytes. */
export function colorAt(stops: Stops, t: number): [number, number, number] {
  const place = Math.min(Math.max(t, 0), 1) * (stops.length - 1);
  const before = Math.min(Math.floor(place), stops.length - 2);
  const a = channels(stops[before] as string);
  const b = channels(stops[before + 1] as string);
  const mix = (i: 0 | 1 | 2): number => Math.round(a[i] + (place - before) * (b[i] - a[i]));
  return [mix(0), mix(1), mix(2)];
}

/** The map as a CSS gradient, low values first. */
export function gradient(stops: Stops, direction = "to right"): string {
  return `linear-gradient(${direction}, ${stops.join(", ")})`;
}

/** Half-width of a range around zero that holds `share` of the values, never 0. */
export function symmetricRange(values: ArrayLike<number>, share = 0.97): number {
  const sizes = Float64Array.from(values, Math.abs).sort();
  return sizes[Math.floor(share * (sizes.length - 1))] || 1;
}

function channels(hex: string): [number, number, number] {
  const value = Number.parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}
