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
  const a = edge(p, i, h);
  const b = edge(p, i, j);
  const n = cross(a, b);
  const product = dot(a, a) * dot(b, b) * dot(sub(a, b), sub(a, b));
  if (product === 0) return;
  const towards = cross(sub(scale(b, dot(a, a)), scale(a, dot(b, b))), n);
  out.set(scale(towards, 2 / product), 3 * i);
}

type Triple = [number, number, number];

function edge(p: ArrayLike<number>, from: number, to: number): Triple {
  const at = (i: number): number => p[i] as number;
  return [at(3 * to) - at(3 * from), at(3 * to + 1) - at(3 * from + 1), at(3 * to + 2) - at(3 * from + 2)];
}

function sub(a: Triple, b: Triple): Triple {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

function scale(a: Triple, s: number): Triple {
  return [s * a[0], s * a[1], s * a[2]];
}

function dot(a: Triple, b: Triple): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function cross(a: Triple, b: Triple): Triple {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
