import { cross, difference, dot, scaled, vectorAt } from "./algebra";
import { distance } from "./vectors";

/** Length along a polyline at each of its points, m. */
export function arcLengths(positions: ArrayLike<number>): Float64Array {
  const lengths = new Float64Array(positions.length / 3);
  for (let i = 1; i < lengths.length; i += 1) {
    lengths[i] = (lengths[i - 1] as number) + distance(positions, 3 * (i - 1), positions, 3 * i);
  }
  return lengths;
}

/** Curvature vectors of a polyline [x0, y0, z0, ...], 1/m: that of the circle through each point and its neighbours,
 * towards the circle's centre. Exact for points on a circle. Open ends take their neighbour's; a closed polyline
 * repeats its first point last. */
export function curvatureVectors(positions: ArrayLike<number>, closed: boolean): Float64Array {
  const count = positions.length / 3;
  const result = new Float64Array(positions.length);
  if (count < 3) return result;
  for (let i = 1; i < count - 1; i += 1) circle(positions, i - 1, i, i + 1, result);
  if (closed) {
    circle(positions, count - 2, 0, 1, result);
    result.set(result.subarray(0, 3), 3 * (count - 1));
  } else {
    result.set(result.slice(3, 6), 0);
    result.set(result.slice(3 * (count - 2), 3 * (count - 1)), 3 * (count - 1));
  }
  return result;
}

/** Lengths of the vectors in a flat list. */
export function norms(vectors: ArrayLike<number>): Float64Array {
  const zero = [0, 0, 0];
  return Float64Array.from({ length: vectors.length / 3 }, (_, i) => distance(vectors, 3 * i, zero, 0));
}

/** Write to out[i] the curvature vector at point i of the circle through points h, i, j. */
function circle(p: ArrayLike<number>, h: number, i: number, j: number, out: Float64Array): void {
  const a = difference(vectorAt(p, h), vectorAt(p, i));
  const b = difference(vectorAt(p, j), vectorAt(p, i));
  const n = cross(a, b);
  const product = dot(a, a) * dot(b, b) * dot(difference(a, b), difference(a, b));
  if (product === 0) return;
  const towards = cross(difference(scaled(b, dot(a, a)), scaled(a, dot(b, b))), n);
  out.set(scaled(towards, 2 / product), 3 * i);
}
