/** Plain maths on flat coordinate lists [x0, y0, z0, x1, ...], m. */

export type Vector = readonly [number, number, number];

export interface Box {
  readonly min: Vector;
  readonly max: Vector;
}

/** Smallest box around all points; undefined when there are none. */
export function boundingBox(lists: Iterable<ArrayLike<number>>): Box | undefined {
  const min: [number, number, number] = [Infinity, Infinity, Infinity];
  const max: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (const list of lists) {
    for (let i = 0; i < list.length; i += 1) {
      const axis = (i % 3) as 0 | 1 | 2;
      const value = list[i] as number;
      if (value < min[axis]) min[axis] = value;
      if (value > max[axis]) max[axis] = value;
    }
  }
  return min[0] <= max[0] ? { min, max } : undefined;
}

/** Diagonal of the smallest box around all points, m; 1 when there are none. */
export function diagonal(lists: Iterable<ArrayLike<number>>): number {
  const box = boundingBox(lists);
  return box ? distance(box.min, 0, box.max, 0) : 1;
}

/** Length of a polyline, m. */
export function polylineLength(positions: ArrayLike<number>): number {
  let length = 0;
  for (let i = 3; i < positions.length; i += 3) length += distance(positions, i - 3, positions, i);
  return length;
}

/** Distance between the points that begin at offsets i and j of two lists. */
export function distance(a: ArrayLike<number>, i: number, b: ArrayLike<number>, j: number): number {
  return Math.hypot(at(a, i) - at(b, j), at(a, i + 1) - at(b, j + 1), at(a, i + 2) - at(b, j + 2));
}

/** `count` points spread evenly by index over a polyline: where the points of its successor come from. */
export function resample(positions: ArrayLike<number>, count: number): Float32Array {
  const result = new Float32Array(3 * count);
  const last = positions.length / 3 - 1;
  if (last < 0) return result;
  for (let i = 0; i < count; i += 1) {
    const place = count > 1 ? (i / (count - 1)) * last : 0;
    const before = Math.min(Math.floor(place), Math.max(last - 1, 0));
    const after = Math.min(before + 1, last);
    for (let axis = 0; axis < 3; axis += 1) {
      const from = at(positions, 3 * before + axis);
      result[3 * i + axis] = from + (place - before) * (at(positions, 3 * after + axis) - from);
    }
  }
  return result;
}

/** `from` moved towards `to` by t in 0..1, written into `out`; points that `from` lacks are already there. */
export function blend(from: ArrayLike<number>, to: ArrayLike<number>, t: number, out: Float32Array): void {
  for (let i = 0; i < to.length; i += 1) {
    const end = at(to, i);
    const start = i < from.length ? at(from, i) : end;
    out[i] = start + t * (end - start);
  }
}

/** Smooth start and end, 0..1 to 0..1. */
export function ease(t: number): number {
  const clamped = Math.min(Math.max(t, 0), 1);
  return clamped * clamped * (3 - 2 * clamped);
}

function at(list: ArrayLike<number>, index: number): number {
  return list[index] as number;
}
