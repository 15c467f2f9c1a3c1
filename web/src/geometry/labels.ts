/** Where numbered labels go on the screen, so that none hides another. */

export interface Anchor {
  readonly id: number;
  readonly x: number;
  readonly y: number;
}

export interface Placement extends Anchor {
  /** Centre of the label, px. */
  readonly labelX: number;
  readonly labelY: number;
}

export interface LabelSize {
  readonly width: number;
  readonly height: number;
}

const DIRECTIONS = 12;
const FIRST_RING = 16;
const RING_STEP = 12;
const RINGS = 24;
/** Radius of an anchor's dot, px. */
const DOT = 4;

/** Place each label beside its anchor: up and right if there is room, else around it, else further out.
 *
 * Order decides who moves: earlier anchors keep their place. Within RINGS rings, no label covers another label or
 * another anchor's dot. */
export function placeLabels(anchors: readonly Anchor[], size: LabelSize): Placement[] {
  const placed: Placement[] = [];
  for (const anchor of anchors) placed.push(firstFree(anchor, anchors, placed, size));
  return placed;
}

function firstFree(
  anchor: Anchor,
  anchors: readonly Anchor[],
  placed: readonly Placement[],
  size: LabelSize,
): Placement {
  let candidate = at(anchor, 0, 0);
  for (let ring = 0; ring < RINGS; ring += 1) {
    for (let turn = 0; turn < DIRECTIONS; turn += 1) {
      candidate = at(anchor, ring, turn);
      const hides = placed.some((other) => overlap(candidate, other, size));
      if (!hides && !anchors.some((other) => covers(candidate, other, size))) return candidate;
    }
  }
  return candidate;
}

function at(anchor: Anchor, ring: number, turn: number): Placement {
  const side = turn % 2 === 0 ? turn / 2 : -(turn + 1) / 2;
  const angle = -Math.PI / 4 + (side * 2 * Math.PI) / DIRECTIONS;
  const radius = FIRST_RING + ring * RING_STEP;
  return { ...anchor, labelX: anchor.x + radius * Math.cos(angle), labelY: anchor.y + radius * Math.sin(angle) };
}

/** Whether a label hides the dot of an anchor. */
export function covers(label: Placement, anchor: Anchor, size: LabelSize): boolean {
  const [x, y] = [Math.abs(label.labelX - anchor.x), Math.abs(label.labelY - anchor.y)];
  return x < size.width / 2 + DOT && y < size.height / 2 + DOT && anchor.id !== label.id;
}

/** Whether two labels of one size hide each other. */
export function overlap(a: Placement, b: Placement, size: LabelSize): boolean {
  return Math.abs(a.labelX - b.labelX) < size.width && Math.abs(a.labelY - b.labelY) < size.height;
}
