import { formatLength } from "../geometry/units";
import { polylineLength, type Vector } from "../geometry/vectors";
import type { Curve, CurveMarks, CurveUpdate, Mark, MeasuredLength, NetworkProblem, NodeProposal, NodeProposals } from "../wire.gen";
import type { Command } from "./history.svelte";
import {
  lengthsWith,
  type MarkPlace,
  marksChanged,
  marksWith,
  newNode,
  placesOf,
  roomFor,
  sameMarks,
  type Segment,
  unmarked,
} from "./marks";
import type { Network } from "./network";
import type { Place } from "./overlay";
import type { CurveEntry, SessionStore } from "./session.svelte";

/** What a person may change about a curve with one click. */
export type CurveFlag = "boundary" | "closed" | "removed";

/** A place on a curve as drawn: the curve, the number of the drawn point, its sample and where it is, m. */
export interface CurvePlace extends MarkPlace {
  readonly point: number;
  readonly position: Vector;
}

/** How the pointer finds what it is at; places are CSS px of the view. */
export interface Eye {
  /** The nearest place of a network's curves, or of some of them, within `reach` px. */
  curveAt(place: Place, network: Network, reach: number, curves?: readonly number[]): CurvePlace | undefined;
  /** The node that a network has there. */
  nodeAt(place: Place, network: Network, except?: number): number | undefined;
}

/** A node that is being drawn along a curve. */
export interface Drag {
  readonly node: number;
  readonly from: MarkPlace;
  /** Where it would go; undefined while the pointer is away from the curve. */
  readonly at: CurvePlace | undefined;
  /** The node that it would become one with. */
  readonly onto: number | undefined;
}

/** px that a pointer may tremble. */
const SLACK = 4;
/** px from a curve at which a click still means it. */
const REACH = 14;
/** px from its curve after which a node is not drawn along any more. */
const HOLD = 60;

/** Editing curves and nodes, by pointer in the 3D view and by key; everything can be taken back. */
export class EditStore {
  /** Whether a pointer in the view marks and moves nodes instead of turning the camera. */
  on = $state(false);
  /** The node that is chosen. */
  node = $state<number>();
  /** Where the next mark would be. */
  cursor = $state.raw<CurvePlace>();
  drag = $state.raw<Drag>();
  /** Nodes that the server found, to be accepted or refused; undefined while nobody asked. */
  proposals = $state.raw<NodeProposals>();
  #grabbed: { readonly node: number; readonly place: Place; readonly network: Network } | undefined;

  constructor(private readonly store: SessionStore) {}

  toggle(): void {
    this.on = !this.on && this.store.scanned;
    if (this.on) this.store.needSamples();
    else this.leave();
  }

  /** Let go of everything. */
  leave(): void {
    this.#grabbed = this.drag = this.cursor = this.node = undefined;
  }

  choose(node: number | undefined): void {
    this.node = this.node === node ? undefined : node;
  }

  // Pointer ---------------------------------------------------------------------------------------------------------

  /** The pointer went down; true when it holds a node now. */
  press(place: Place, eye: Eye): boolean {
    const { network } = this.store;
    const node = this.on ? eye.nodeAt(place, network) : undefined;
    this.#grabbed = node === undefined ? undefined : { node, place, network };
    return node !== undefined;
  }

  move(place: Place, eye: Eye): void {
    if (this.#grabbed) this.#dragTo(place, eye);
    else if (this.on) this.cursor = this.#markable(place, eye);
  }

  /** The pointer went up. */
  async release(): Promise<void> {
    const [grabbed, drag] = [this.#grabbed, this.drag];
    this.#grabbed = this.drag = undefined;
    if (drag?.onto !== undefined) await this.renumber(drag.node, drag.onto);
    else if (drag?.at) await this.moveMark(drag.node, drag.from, drag.at.sample);
    else if (drag) this.store.tryOut();
    else if (grabbed) this.choose(grabbed.node);
  }

  /** A drag is not wanted any more. */
  cancel(): void {
    if (this.drag) this.store.tryOut();
    this.leave();
  }

  /** Mark a node where the cursor is. */
  async markAtCursor(): Promise<void> {
    if (this.cursor) await this.addMark(this.cursor);
  }

  // Keys ------------------------------------------------------------------------------------------------------------

  /** Move what is chosen along a curve: the mark of the chosen node, else the cursor by so many drawn points. */
  async step(by: number, curve: number | undefined): Promise<void> {
    const places = this.node === undefined ? [] : placesOf(this.store.details, this.node);
    const place = places.find((p) => p.curve === curve) ?? places[0];
    if (this.node !== undefined && place) await this.nudge(this.node, place, by);
    else if (curve !== undefined) this.#moveCursor(curve, by);
  }

  /** Split the chosen node's mark on a curve off, or its last one. */
  async splitChosen(curve: number | undefined): Promise<void> {
    const places = this.node === undefined ? [] : placesOf(this.store.details, this.node);
    const place = places.find((p) => p.curve === curve) ?? places.at(-1);
    if (this.node !== undefined && place && places.length > 1) await this.split(this.node, place);
  }

  /** Mark a node at the end of the curve that is being scanned. */
  async markNow(node?: number): Promise<void> {
    await this.store.command(async () => {
      const curve = (await this.store.api.curves(this.store.id)).findLast(({ ended, samples }) => !ended && samples > 0);
      if (curve) await this.addMark({ curve: curve.index, sample: curve.samples - 1 }, node);
    });
  }

  // Edits -----------------------------------------------------------------------------------------------------------

  /** Change a curve. */
  async change(curve: CurveEntry, flag: CurveFlag, value: boolean): Promise<void> {
    const set = (to: boolean): Promise<void> => this.store.write([{ index: curve.index, change: { [flag]: to } }]);
    const label = `curve ${curve.index + 1} ${nowIs(flag, value)}`;
    await this.store.command(() => this.store.history.do({ label, run: () => set(value), revert: () => set(!value) }));
  }

  /** Do what the server proposes to mend a problem. */
  async mend({ fix }: NetworkProblem): Promise<void> {
    if (!fix) return;
    if (!fix.changes.length) return this.findNodes();
    const changes = fix.changes.map(({ curve, change }) => ({ index: curve, change: given(change) }));
    const before = changes.map(({ index, change }) => ({ index, change: this.#asItIs(index, change) }));
    const { store } = this;
    const command = { label: fix.label, run: () => store.write(changes), revert: () => store.write(before) };
    await store.command(() => store.history.do(command));
  }

  /** Mark a node, a new one unless its number is given. */
  async addMark(place: MarkPlace, node?: number): Promise<void> {
    const number = (curves: readonly Curve[]): number => node ?? newNode(curves);
    await this.#editMarks(
      (curves) => `node ${number(curves)} marked`,
      ({ index, marks }, curves) => (index === place.curve ? marksWith(marks, [place], number(curves)) : marks),
    );
  }

  async moveMark(node: number, { curve, sample }: MarkPlace, to: number): Promise<void> {
    await this.#editMarks(
      () => `node ${node} moved`,
      ({ index, marks }) => (index === curve ? marksChanged(marks, { sample, node }, { sample: to }) : marks),
    );
  }

  /** Move a mark by so many samples, as far as there is room. */
  async nudge(node: number, place: MarkPlace, by: number): Promise<void> {
    const to = this.#within(place, place.sample + by);
    if (to !== place.sample) await this.moveMark(node, place, to);
  }

  /** Give one mark of a node a number of its own. */
  async split(node: number, { curve, sample }: MarkPlace): Promise<void> {
    await this.#editMarks(
      (curves) => `node ${newNode(curves)} split off node ${node}`,
      ({ index, marks }, curves) =>
        index === curve ? marksChanged(marks, { sample, node }, { node: newNode(curves) }) : marks,
    );
  }

  async deleteMark(node: number, { curve, sample }: MarkPlace): Promise<void> {
    await this.#editMarks(
      () => `node ${node} taken off curve ${curve + 1}`,
      ({ index, marks }) => (index === curve ? marksChanged(marks, { sample, node }, undefined) : marks),
    );
  }

  /** Let all marks of a node name another one, which joins the two if both exist. */
  async renumber(node: number, to: number): Promise<void> {
    this.node = to;
    await this.#editMarks(
      (curves) => (placesOf(curves, to).length ? `node ${node} joined with ${to}` : `node ${node} is now ${to}`),
      ({ marks }) => marks.map((mark) => (mark.node === node ? { ...mark, node: to } : mark)),
    );
  }

  async deleteNode(node: number): Promise<void> {
    this.node = undefined;
    await this.#editMarks(
      () => `node ${node} deleted`,
      ({ marks }) => marks.filter((mark) => mark.node !== node),
    );
  }

  /** Say how long a segment is, m, as somebody measured it; undefined: nobody did. */
  async measure(curve: number, segment: Segment, length: number | undefined): Promise<void> {
    const old = this.store.detailsOf(curve)?.lengths ?? [];
    const set = (lengths: MeasuredLength[]): Promise<void> => this.store.write([{ index: curve, change: { lengths } }]);
    const name = `length of ${segment.name}`;
    const label = length === undefined ? `${name} not measured any more` : `${name} measured: ${formatLength(length)}`;
    const fresh = lengthsWith(old, segment, length);
    await this.store.command(() => this.store.history.do({ label, run: () => set(fresh), revert: () => set(old) }));
  }

  // Proposals -------------------------------------------------------------------------------------------------------

  /** Ask the server where curves seem to meet without a mark. */
  async findNodes(): Promise<void> {
    const { api, id } = this.store;
    await this.store.command(async () => {
      const [found, curves] = await Promise.all([api.proposals(id), api.curves(id)]);
      this.proposals = { ...found, proposals: unmarked(found.proposals, curves) };
    });
  }

  /** Mark a proposed node on its curves. */
  async accept(proposal: NodeProposal): Promise<void> {
    const number = (curves: readonly Curve[]): number => proposal.node ?? newNode(curves);
    await this.#editMarks(
      (curves) => `node ${number(curves)} marked`,
      ({ index, marks }, curves) =>
        marksWith(marks, proposal.places.filter((place) => place.curve === index), number(curves)),
    );
    this.refuse(proposal);
  }

  /** Take a proposal off the list. */
  refuse(proposal: NodeProposal): void {
    const { proposals } = this;
    if (proposals) this.proposals = { ...proposals, proposals: proposals.proposals.filter((p) => p !== proposal) };
  }

  /** What a curve has now of what a change changes. */
  #asItIs(index: number, change: Partial<CurveUpdate>): Partial<CurveUpdate> {
    const now: Partial<CurveUpdate> = { removed: false, ...this.store.detailsOf(index) };
    return Object.fromEntries(Object.keys(change).map((name) => [name, now[name as keyof CurveUpdate]]));
  }

  #markable(place: Place, eye: Eye): CurvePlace | undefined {
    const { network } = this.store;
    return eye.nodeAt(place, network) === undefined ? eye.curveAt(place, network, REACH) : undefined;
  }

  /** The network as it was when the node was taken is what the pointer is compared with: it holds still. */
  #dragTo(place: Place, eye: Eye): void {
    const grabbed = this.#grabbed;
    if (!grabbed || (!this.drag && Math.hypot(place.x - grabbed.place.x, place.y - grabbed.place.y) < SLACK)) return;
    const { node, network } = grabbed;
    const places = this.drag ? [this.drag.from] : placesOf(this.store.details, node);
    const found = eye.curveAt(place, network, HOLD, places.map(({ curve }) => curve));
    const from = this.drag?.from ?? (found && nearest(places.filter(({ curve }) => curve === found.curve), found.sample));
    if (!from) return;
    const onto = eye.nodeAt(place, network, node);
    const at = found && onto === undefined ? { ...found, sample: this.#within(from, found.sample) } : undefined;
    this.drag = { node, from, at, onto };
    this.store.tryOut(at ? [this.#marksMoved(node, from, at)] : []);
  }

  #marksMoved(node: number, { curve, sample }: MarkPlace, to: MarkPlace): CurveMarks {
    return { curve, marks: marksChanged(this.#marks(curve), { sample, node }, { sample: to.sample }) };
  }

  #moveCursor(curve: number, by: number): void {
    const count = this.store.network.curves.get(curve)?.points.samples.length ?? 0;
    const from = this.cursor?.curve === curve ? this.cursor.point + by : 0;
    this.cursor = placeOn(this.store.network, curve, Math.min(Math.max(from, 0), count - 1));
  }

  #within({ curve, sample }: MarkPlace, wanted: number): number {
    const [low, high] = roomFor(this.#marks(curve), sample, this.store.detailsOf(curve)?.samples ?? 0);
    return Math.min(Math.max(wanted, low), high);
  }

  #marks(curve: number): readonly Mark[] {
    return this.store.detailsOf(curve)?.marks ?? [];
  }

  /** Replace the marks of every curve that `edited` changes. */
  async #editMarks(
    label: (curves: readonly Curve[]) => string,
    edited: (curve: Curve, curves: readonly Curve[]) => Mark[],
  ): Promise<void> {
    const { api, id, history } = this.store;
    const plan = async (): Promise<Command | undefined> => {
      const curves = await api.curves(id);
      const changes = curves
        .map((curve) => ({ index: curve.index, old: curve.marks, fresh: edited(curve, curves) }))
        .filter(({ old, fresh }) => !sameMarks(old, fresh));
      if (!changes.length) return undefined;
      const set = (which: "old" | "fresh"): Promise<void> =>
        this.store.write(changes.map((change) => ({ index: change.index, change: { marks: change[which] } })));
      return { label: label(curves), run: () => set("fresh"), revert: () => set("old") };
    };
    await this.store.command(() => history.plan(plan));
  }
}

/** The place on a curve that is drawn as its n-th point; undefined where its samples are not known. */
export function placeOn(network: Network, curve: number, point: number): CurvePlace | undefined {
  const points = network.curves.get(curve)?.points;
  const sample = points?.samples[point];
  if (!points || sample === undefined) return undefined;
  const [x = 0, y = 0, z = 0] = points.coordinates.subarray(3 * point, 3 * point + 3);
  return { curve, sample, point, position: [x, y, z] };
}

/** Length along a curve up to a place on it, m. */
export function lengthUpTo(network: Network, place: CurvePlace): number {
  const points = network.curves.get(place.curve)?.points;
  return points ? polylineLength(points.coordinates.subarray(0, 3 * place.point + 3)) : 0;
}

/** What a change changes; the server sends the rest as null. */
function given(change: CurveUpdate): Partial<CurveUpdate> {
  return Object.fromEntries(Object.entries(change).filter(([, value]) => value !== null));
}

function nearest(places: readonly MarkPlace[], sample: number): MarkPlace | undefined {
  const away = (place: MarkPlace): number => Math.abs(place.sample - sample);
  return places.reduce<MarkPlace | undefined>((best, p) => (best && away(best) <= away(p) ? best : p), undefined);
}

function nowIs(flag: CurveFlag, value: boolean): string {
  if (flag === "boundary") return value ? "made boundary" : "made interior";
  if (flag === "closed") return value ? "closed" : "opened";
  return value ? "removed" : "brought back";
}
