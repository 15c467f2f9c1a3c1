/** Tubes of varying radius around a polyline. */

import { cross, difference, dot, scaled, unit, vectorAt } from "./algebra";
import type { Vector } from "./vectors";

export interface Tube {
  /** m, a ring of `sides` points around each point of the polyline. */
  readonly positions: Float32Array;
  /** Unit, outward. */
  readonly normals: Float32Array;
  readonly indices: Uint32Array;
}

/** Rings around the points (flat, m) with these radii (m, one a point), turned as little as possible from ring to ring. */
export function tube(points: ArrayLike<number>, radii: ArrayLike<number>, sides: number): Tube {
  const count = Math.floor(points.length / 3);
  const positions = new Float32Array(3 * sides * count);
  const normals = new Float32Array(3 * sides * count);
  let side: Vector = [0, 0, 0];
  for (let i = 0; i < count; i += 1) {
    const along = direction(points, i, count);
    side = across(side, along);
    const up = cross(along, side);
    for (let k = 0; k < sides; k += 1) {
      const [c, s] = [Math.cos((2 * Math.PI * k) / sides), Math.sin((2 * Math.PI * k) / sides)];
      for (const axis of [0, 1, 2] as const) {
        const place = 3 * (i * sides + k) + axis;
        normals[place] = c * side[axis] + s * up[axis];
        positions[place] = (points[3 * i + axis] as number) + (radii[i] as number) * (normals[place] as number);
      }
    }
  }
  return { positions, normals, indices: quads(count, sides) };
}

function direction(points: ArrayLike<number>, i: number, count: number): Vector {
  const [before, after] = [vectorAt(points, Math.max(i - 1, 0)), vectorAt(points, Math.min(i + 1, count - 1))];
  return unit(difference(after, before)) ?? [0, 0, 1];
}

/** The old direction less what of it runs along the curve; any direction across when nothing is left of it. */
function across(old: Vector, along: Vector): Vector {
  const axis: Vector = Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  return unit(difference(old, scaled(along, dot(old, along)))) ?? (unit(cross(axis, along)) as Vector);
}

function quads(rings: number, sides: number): Uint32Array {
  const indices: number[] = [];
  for (let i = 0; i + 1 < rings; i += 1) {
    for (let k = 0; k < sides; k += 1) {
      const [a, b] = [i * sides + k, i * sides + ((k + 1) % sides)];
      indices.push(a, b, a + sides, b, b + sides, a + sides);
    }
  }
  return Uint32Array.from(indices);
}
