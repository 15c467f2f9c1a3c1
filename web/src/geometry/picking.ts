/** What of a drawing on the screen is nearest to a pointer. Places are flat lists [x0, y0, x1, ...] in px; what is behind
 * the eye is NaN. */

export interface Hit {
  /** Number of the line. */
  readonly line: number;
  /** Number of its nearest point. */
  readonly point: number;
  /** Distance of the pointer from the line, px. */
  readonly distance: number;
}

/** The line nearest to (x, y), and its point on that side; undefined when there is nothing to see. */
export function nearestOnLines(lines: readonly ArrayLike<number>[], x: number, y: number): Hit | undefined {
  let best: Hit | undefined;
  lines.forEach((line, number) => {
    for (let i = 0; i < line.length / 2 - 1; i += 1) {
      const { distance, share } = fromSegment(line, 2 * i, x, y);
      if (distance < (best?.distance ?? Infinity)) best = { line: number, point: share < 0.5 ? i : i + 1, distance };
    }
  });
  return best;
}

/** Number of the place nearest to (x, y), if it is within `reach` px. */
export function nearestPlace(places: ArrayLike<number>, x: number, y: number, reach: number): number | undefined {
  let [best, found] = [reach, undefined as number | undefined];
  for (let i = 0; i < places.length / 2; i += 1) {
    const distance = Math.hypot((places[2 * i] as number) - x, (places[2 * i + 1] as number) - y);
    if (distance <= best) [best, found] = [distance, i];
  }
  return found;
}

function fromSegment(line: ArrayLike<number>, i: number, x: number, y: number): { distance: number; share: number } {
  const [ax, ay] = [line[i] as number, line[i + 1] as number];
  const [ux, uy] = [(line[i + 2] as number) - ax, (line[i + 3] as number) - ay];
  const length = ux * ux + uy * uy;
  const share = length > 0 ? Math.min(Math.max(((x - ax) * ux + (y - ay) * uy) / length, 0), 1) : 0;
  return { distance: Math.hypot(ax + share * ux - x, ay + share * uy - y), share };
}
