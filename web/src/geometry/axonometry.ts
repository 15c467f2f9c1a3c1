import { type Box, boundingBox } from "./vectors";

const TURN = (-28 * Math.PI) / 180;
const TILT = (38 * Math.PI) / 180;

export interface Fit {
  readonly scale: number;
  readonly x: number;
  readonly y: number;
}

/** A world point (m, z up) seen from the South and above, in parallel projection: right and down, m. */
export function seen(x: number, y: number, z: number): [number, number] {
  const right = x * Math.cos(TURN) - y * Math.sin(TURN);
  const away = x * Math.sin(TURN) + y * Math.cos(TURN);
  return [right, -(away * Math.sin(TILT) + z * Math.cos(TILT))];
}

/** All points of flat lists, seen: [right, down, right, down, ...]. */
export function allSeen(positions: ArrayLike<number>): Float64Array {
  const result = new Float64Array((2 * positions.length) / 3);
  for (let i = 0; i < positions.length / 3; i += 1) {
    result.set(seen(positions[3 * i] as number, positions[3 * i + 1] as number, positions[3 * i + 2] as number), 2 * i);
  }
  return result;
}

/** Scale and shift that bring what is seen into a picture of this size with a margin, px. */
export function fitInto(lists: readonly ArrayLike<number>[], width: number, height: number, margin: number): Fit | undefined {
  const flat = lists.map((list) => spread(list));
  const box: Box | undefined = boundingBox(flat);
  if (!box) return undefined;
  const [w, h] = [Math.max(box.max[0] - box.min[0], 1e-3), Math.max(box.max[1] - box.min[1], 1e-3)];
  const scale = Math.min((width - 2 * margin) / w, (height - 2 * margin) / h);
  const middle = (axis: 0 | 1): number => (box.min[axis] + box.max[axis]) / 2;
  return { scale, x: width / 2 - scale * middle(0), y: height / 2 - scale * middle(1) };
}

/** SVG paths of lines (flat lists, m) that fill a picture of this size with a margin, px; empty when there are none. */
export function linePaths(lists: readonly ArrayLike<number>[], width: number, height: number, margin: number): string[] {
  const lines = lists.map((list) => allSeen(list));
  const fit = fitInto(lines, width, height, margin);
  if (!fit) return [];
  const place = (value: number | undefined, shift: number): string => (shift + fit.scale * (value ?? 0)).toFixed(1);
  return lines.map((line) => {
    const pairs = Array.from({ length: line.length / 2 }, (_, i) => `${place(line[2 * i], fit.x)} ${place(line[2 * i + 1], fit.y)}`);
    return pairs.length ? `M${pairs.join("L")}` : "";
  });
}

function spread(list: ArrayLike<number>): Float64Array {
  const result = new Float64Array((3 * list.length) / 2);
  for (let i = 0; i < list.length / 2; i += 1) result.set([list[2 * i] as number, list[2 * i + 1] as number], 3 * i);
  return result;
}
