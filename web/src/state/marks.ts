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

/** A stretch of a curve between two neighbouring marks; a curve without marks is one, and the ends of an open curve with
 * one mark are two. */
export interface Segment {
  /** What people call it: the nodes at its ends. */
  readonly name: string;
  /** Samples at its ends. */
  readonly first: number;
  readonly last: number;
  /** m, if somebody measured it. */
  readonly measured: number | undefined;
}

/** The segments of a curve in its order; a closed one returns to its first mark. */
export function segmentsOf(curve: Pick<Curve, "marks" | "closed" | "lengths" | "samples">): Segment[] {
  const ends = segmentEnds(curve);
  const final = curve.samples - 1;
  if (!ends.length) return final > 0 ? [segment(curve, "whole curve", 0, final)] : [];
  if (ends.length === 1) return looseEnds(curve, ends[0] as Mark, final);
  return ends.slice(1).map((last, i) => {
    const first = ends[i] as Mark;
    return segment(curve, `${first.node}–${last.node}`, first.sample, last.sample);
  });
}

function looseEnds(curve: Pick<Curve, "lengths">, { sample, node }: Mark, final: number): Segment[] {
  const before = sample > 0 ? [segment(curve, `start–${node}`, 0, sample)] : [];
  return sample < final ? [...before, segment(curve, `${node}–end`, sample, final)] : before;
}

function segmentEnds({ marks, closed }: Pick<Curve, "marks" | "closed">): readonly Mark[] {
  const [first, final] = [marks[0], marks.at(-1)];
  const returns = marks.length > 1 && first?.node === final?.node;
  return closed && first && !returns ? [...marks, first] : marks;
}

function segment({ lengths }: Pick<Curve, "lengths">, name: string, first: number, last: number): Segment {
  return { name, first, last, measured: lengths.find((known) => known.first === first && known.last === last)?.length };
}

/** Measured lengths with that of one segment set (m), or taken away. */
export function lengthsWith(
  lengths: readonly MeasuredLength[],
  { first, last }: Segment,
  length: number | undefined,
): MeasuredLength[] {
  const others = lengths.filter((known) => known.first !== first || known.last !== last);
  return length === undefined ? others : [...others, { first, last, length }];
}
