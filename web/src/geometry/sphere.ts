import type { Vector } from "./vectors";

/** A polyline on the unit sphere as the eye sees it, in pieces that lie wholly before or behind its outline. */
export interface Piece {
  readonly front: boolean;
  /** [right, up, right, up, ...] in units of the radius. */
  readonly places: readonly number[];
}

/** Turn a flat list of unit vectors by `axes` (the world's axes as the eye sees them) and cut it at the outline. */
export function piecesOnSphere(vectors: ArrayLike<number>, axes: readonly [Vector, Vector, Vector]): Piece[] {
  const pieces: { front: boolean; places: number[] }[] = [];
  for (let i = 0; i < vectors.length; i += 3) {
    const [right, up, towards] = turned(vectors, i, axes);
    const last = pieces.at(-1);
    const front = towards >= 0;
    if (!last || last.front !== front) {
      pieces.push({ front, places: [...(last?.places.slice(-2) ?? []), right, up] });
    } else {
      last.places.push(right, up);
    }
  }
  return pieces;
}

/** The vector at offset i as the eye sees it: right, up, towards it. */
export function turned(vectors: ArrayLike<number>, i: number, [x, y, z]: readonly [Vector, Vector, Vector]): Vector {
  const [a, b, c] = [vectors[i] as number, vectors[i + 1] as number, vectors[i + 2] as number];
  const along = (k: 0 | 1 | 2): number => a * x[k] + b * y[k] + c * z[k];
  return [along(0), along(1), along(2)];
}
