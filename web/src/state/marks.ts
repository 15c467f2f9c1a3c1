import type { Curve, Mark, MeasuredLength, NodePlace, NodeProposal } from "../wire.gen";

/** A curve's marks with a node marked at more places, in the order of the samples; nothing is marked twice. */
export function marksWith(marks: readonly Mark[], places: readonly NodePlace[], node: number): Mark[] {
  const fresh = places.filter(({ sample }) => !marks.some((mark) => mark.sample === sample && mark.node === node));
  return [...marks, ...fresh.map(({ sample }) => ({ sample, node }))].sort((a, b) => a.sample - b.sample);
}

export function sameMarks(a: readonly Mark[], b: readonly Mark[]): boolean {
  return a.length === b.length && a.every((mark, i) => mark.sample === b[i]?.sample && mark.node === b[i]?.node);
}

/** What of the proposals is not marked yet; a curve that has the node already needs no second mark of it. */
export function unmarked(proposals: readonly NodeProposal[], curves: readonly Curve[]): NodeProposal[] {
  const isMarked = (place: NodePlace, node: number | null): boolean =>
    curves.some(({ index, marks }) => index === place.curve && marks.some((mark) => mark.node === node));
  return proposals
    .map((proposal) => ({ ...proposal, places: proposal.places.filter((place) => !isMarked(place, proposal.node)) }))
    .filter((proposal) => proposal.places.length > 0);
}

/** A number that no node of these curves has. */
export function newNode(curves: readonly Curve[]): number {
  return Math.max(-1, ...curves.flatMap((curve) => curve.marks.map((mark) => mark.node))) + 1;
}

/** A mark of a node on a curve. */
export interface MarkPlace {
  readonly curve: number;
  readonly sample: number;
}

/** Where a node is marked, curve by curve. */
export function placesOf(curves: readonly Curve[], node: number): MarkPlace[] {
  return curves.flatMap(({ index, marks }) =>
    marks.filter((mark) => mark.node === node).map(({ sample }) => ({ curve: index, sample })),
  );
}

/** First and last sample that a mark of a curve may move to: between its neighbours, one sample away from each. */
export function roomFor(marks: readonly Mark[], sample: number, count: number): readonly [number, number] {
  const before = marks.filter((mark) => mark.sample < sample).map((mark) => mark.sample + 1);
  const after = marks.filter((mark) => mark.sample > sample).map((mark) => mark.sample - 1);
  return [Math.max(0, ...before), Math.min(count - 1, ...after)];
}

/** A curve's marks with the one at a sample changed, or taken away; in the order of the samples. */
export function marksChanged(marks: readonly Mark[], { sample, node }: Mark, to: Partial<Mark> | undefined): Mark[] {
  const isIt = (mark: Mark): boolean => mark.sample === sample && mark.node === node;
  const changed = marks.flatMap((mark) => (isIt(mark) ? (to ? [{ ...mark, ...to }] : []) : [mark]));
  return changed.sort((a, b) => a.sample - b.sample);
}

/** A stretch of a curve between two neighbouring marks. */
export interface SegmentEnds {
  readonly first: Mark;
  readonly last: Mark;
  /** m, if somebody measured it. */
  readonly measured: number | undefined;
}

/** The segments of a curve in its order; a closed one returns to its first mark. */
export function segmentsOf({ marks, closed, lengths }: Pick<Curve, "marks" | "closed" | "lengths">): SegmentEnds[] {
  const [first, final] = [marks[0], marks.at(-1)];
  const returns = marks.length > 1 && first?.node === final?.node;
  const ends = closed && first && !returns ? [...marks, first] : marks;
  return ends.slice(1).map((last, i) => {
    const from = ends[i] as Mark;
    const known = lengths.find((length) => length.first === from.sample && length.last === last.sample);
    return { first: from, last, measured: known?.length };
  });
}

/** Measured lengths with that of one segment set (m), or taken away. */
export function lengthsWith(
  lengths: readonly MeasuredLength[],
  { first, last }: SegmentEnds,
  length: number | undefined,
): MeasuredLength[] {
  const others = lengths.filter((known) => known.first !== first.sample || known.last !== last.sample);
  return length === undefined ? others : [...others, { first: first.sample, last: last.sample, length }];
}
