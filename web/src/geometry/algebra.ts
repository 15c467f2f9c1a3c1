/** Vectors of three components. */

import type { Vector } from "./vectors";

/** The vector that begins at entry 3 i of a flat list. */
export function vectorAt(list: ArrayLike<number>, i: number): Vector {
  return [list[3 * i] as number, list[3 * i + 1] as number, list[3 * i + 2] as number];
}

export function difference(a: Vector, b: Vector): Vector {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function scaled(a: Vector, s: number): Vector {
  return [s * a[0], s * a[1], s * a[2]];
}

export function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** The same direction with length 1; undefined for a vector without direction. */
export function unit(a: Vector): Vector | undefined {
  const length = Math.hypot(...a);
  return length > 1e-12 ? scaled(a, 1 / length) : undefined;
}
