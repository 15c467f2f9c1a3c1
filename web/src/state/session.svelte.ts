import { type Api, ApiProblem } from "../protocol/api";
import { type Connection, LiveSocket, socketUrl } from "../protocol/live";
import type { ToBrowser } from "../protocol/messages";
import { polylineLength } from "../geometry/vectors";
import type {
  Curve,
  LiveDevice,
  Mark,
  NodeProposal,
  NodeProposals,
  Reconstruction,
  ReconstructionParameters,
  RecordingSummary,
  Session,
} from "../wire.gen";
import { putIn } from "./files";
import { History } from "./history.svelte";
import { Network } from "./network";
import { Latest } from "./latest";
import { marksWith, newNode, sameMarks, unmarked } from "./marks";
import { newName } from "./names";
import { loadResult, type Report, type Result } from "./result";

/** A curve as the list of curves names it. */
export interface CurveEntry {
  readonly index: number;
  readonly boundary: boolean;
  readonly closed: boolean;
  readonly ended: boolean;
  /** m, as drawn. */
  readonly length: number;
}

/** What a person may change about a curve with one click. */
export type CurveFlag = "boundary" | "closed" | "removed";

const LIST_PAUSE = 250;
/** ms without a word of a running job after which it is asked. */
const SILENCE = 2000;

/** Everything about the session that is open. High-rate data (points) stays outside the reactive graph; `revision`
 * tells those who draw it that it changed. */
export class SessionStore {
  readonly live = new Network();
  readonly history = new History();
  session = $state<Session>();
  connection = $state<Connection>("connecting");
  devices = $state.raw<readonly LiveDevice[]>([]);
  curves = $state.raw<readonly CurveEntry[]>([]);
  nodes = $state.raw<readonly number[]>([]);
  /** Whether the server told what there is. */
  known = $state(false);
  /** Whether curves were scanned here, which may be edited; a network that was opened is as it is in its file. */
  scanned = $state(false);
  reconstruction = $state.raw<Reconstruction>();
  result = $state.raw<Result>();
  /** The network with parameters that a hand is moving. */
  preview = $state.raw<{ readonly network: Network; readonly report: Report }>();
  /** Nodes that the server found, to be accepted or refused; undefined while nobody asked. */
  proposals = $state.raw<NodeProposals>();
  recordings = $state.raw<readonly RecordingSummary[]>([]);
  problem = $state("");
  /** Counts changes of the drawn network. */
  revision = $state(0);
  /** Counts those changes after which points lie elsewhere. */
  replacements = $state(0);
  #socket: LiveSocket | undefined;
  /** The newest reconstruction whose results were asked for: none is shown twice, none after a newer one. */
  #loading: string | undefined;
  readonly #client = newName("page");
  readonly #previews = new Latest((parameters: Partial<ReconstructionParameters>) => this.#try(parameters));
  #listTimer: ReturnType<typeof setTimeout> | undefined;
  #progressTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly api: Api,
    readonly id: string,
  ) {}

  /** True while a curve is being scanned. */
  get scanning(): boolean {
    return this.curves.some((curve) => !curve.ended);
  }

  /** What is drawn: the preview while parameters are moved, else the reconstructed network once there is one and
   * nothing was scanned since, else the live one. */
  get network(): Network {
    return this.preview?.network ?? this.result?.network ?? this.live;
  }

  async open(): Promise<void> {
    await this.#attempt(async () => {
      this.session = await this.api.session(this.id);
      const url = socketUrl(`/api/v1/sessions/${this.id}/live`, location);
      this.#socket = new LiveSocket(url, { message: (m) => this.receive(m), state: (s) => (this.connection = s) });
      const latest = this.session.latest_reconstruction;
      if (latest) await this.#show(await this.api.reconstruction(latest));
    });
  }

  close(): void {
    clearTimeout(this.#listTimer);
    clearTimeout(this.#progressTimer);
    this.#socket?.close();
  }

  receive(message: ToBrowser): void {
    switch (message.type) {
      case "live.device":
        this.#heard([message]);
        break;
      case "live.reconstruction":
        this.#progressed(message.reconstruction);
        break;
      default:
        this.#fold(message);
    }
  }

  async rename(name: string): Promise<void> {
    await this.#command(async () => (this.session = await this.api.renameSession(this.id, name)));
  }

  /** Take in files as if devices had sent them. */
  async upload(files: readonly File[]): Promise<void> {
    await this.#command(async () => {
      for (const file of files) await putIn(this.api, this.id, file);
      this.#outdate();
    });
  }

  /** Begin a reconstruction; one that is under way is not wanted any more. */
  async reconstruct(parameters: Partial<ReconstructionParameters>): Promise<void> {
    const before = this.reconstruction;
    await this.#command(async () => this.#progressed(await this.api.reconstruct(this.id, parameters)));
    if (before && isBusy(before)) await this.api.cancel(before.id).catch(() => undefined);
  }

  /** Draw the network with these parameters as soon as it can be had; only the newest wish counts. */
  tryOut(parameters: Partial<ReconstructionParameters>): void {
    void this.#previews.want(parameters);
  }

  async cancel(): Promise<void> {
    const { reconstruction } = this;
    if (reconstruction) await this.#command(async () => this.#progressed(await this.api.cancel(reconstruction.id)));
  }

  /** Change a curve; can be taken back. */
  async edit(curve: CurveEntry, flag: CurveFlag, value: boolean): Promise<void> {
    const set = async (to: boolean): Promise<void> => {
      await this.api.updateCurve(this.id, curve.index, { [flag]: to });
      this.#outdate();
    };
    const label = `curve ${curve.index + 1} ${nowIs(flag, value)}`;
    await this.#command(() => this.history.do({ label, run: () => set(value), revert: () => set(!value) }));
  }

  /** Ask the server where curves seem to meet without a mark. */
  async findNodes(): Promise<void> {
    await this.#command(async () => {
      const [found, curves] = await Promise.all([this.api.proposals(this.id), this.api.curves(this.id)]);
      this.proposals = { ...found, proposals: unmarked(found.proposals, curves) };
    });
  }

  /** Mark a proposed node on its curves; can be taken back. */
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

  /** Let all marks of a node name another one, which joins the two if both exist; undefined deletes them. */
  async editNode(node: number, to: number | undefined): Promise<void> {
    await this.#editMarks(
      () => `node ${node} ${to === undefined ? "deleted" : `is now ${to}`}`,
      ({ marks }) =>
        to === undefined
          ? marks.filter((mark) => mark.node !== node)
          : marks.map((mark) => (mark.node === node ? { ...mark, node: to } : mark)),
    );
  }

  async undo(): Promise<void> {
    await this.#command(() => this.history.undo());
  }

  async redo(): Promise<void> {
    await this.#command(() => this.history.redo());
  }

  /** Replace the marks of every curve that `edited` changes; can be taken back. */
  async #editMarks(
    label: (curves: readonly Curve[]) => string,
    edited: (curve: Curve, curves: readonly Curve[]) => Mark[],
  ): Promise<void> {
    await this.#command(async () => {
      const curves = await this.api.curves(this.id);
      const changes = curves
        .map((curve) => ({ index: curve.index, old: curve.marks, fresh: edited(curve, curves) }))
        .filter(({ old, fresh }) => !sameMarks(old, fresh));
      const set = async (which: "old" | "fresh"): Promise<void> => {
        for (const change of changes) await this.api.updateCurve(this.id, change.index, { marks: change[which] });
        this.#outdate();
      };
      await this.history.do({ label: label(curves), run: () => set("fresh"), revert: () => set("old") });
    });
  }

  #fold(message: Exclude<ToBrowser, LiveDevice | { type: "live.reconstruction" }>): void {
    const change = this.live.apply(message);
    if (change === "gap") return this.#socket?.restart();
    if (message.type === "live.snapshot" || message.type === "live.curve.start") void this.#listRecordings();
    if (message.type === "live.snapshot") {
      this.known = true;
      this.#heard(message.devices);
      if (message.reconstruction) this.#progressed(message.reconstruction);
    }
    if (message.type === "live.curve.start" || message.type === "live.points") this.#outdate();
    if (change === "replaced") this.replacements += 1;
    this.revision += 1;
    this.#listSoon();
  }

  #heard(devices: readonly LiveDevice[]): void {
    const others = this.devices.filter((old) => !devices.some((device) => device.recording === old.recording));
    this.devices = [...others, ...devices].sort((a, b) => a.recording.localeCompare(b.recording));
  }

  #progressed(reconstruction: Reconstruction): void {
    if (this.reconstruction && reconstruction.created < this.reconstruction.created) return;
    this.reconstruction = reconstruction;
    clearTimeout(this.#progressTimer);
    if (isBusy(reconstruction)) this.#progressTimer = setTimeout(() => void this.#ask(reconstruction.id), SILENCE);
    if (reconstruction.state === "done") void this.#attempt(() => this.#show(reconstruction));
  }

  /** The live path may drop what it has to say, so a job that is silent is asked. */
  async #ask(id: string): Promise<void> {
    await this.#attempt(async () => this.#progressed(await this.api.reconstruction(id)));
  }

  async #show(reconstruction: Reconstruction): Promise<void> {
    if (this.#loading === reconstruction.id) return;
    this.#loading = reconstruction.id;
    this.reconstruction ??= reconstruction;
    const result = await loadResult(this.api, reconstruction);
    if (this.#loading !== reconstruction.id) return;
    this.result = result;
    this.preview = undefined;
    this.#redraw();
  }

  async #try(parameters: Partial<ReconstructionParameters>): Promise<void> {
    await this.#command(async () => {
      const { curves, nodes, report } = await this.api.preview(this.id, this.#client, parameters);
      const network = new Network();
      network.apply({ type: "live.network", curves, nodes });
      this.preview = { network, report: { network: report } };
      this.#redraw();
    });
  }

  /** Points were scanned that no result has: show what is live. */
  #outdate(): void {
    if (!this.result && !this.preview) return;
    this.result = this.preview = undefined;
    this.#redraw();
  }

  #redraw(): void {
    this.replacements += 1;
    this.revision += 1;
    this.#listSoon();
  }

  async #listRecordings(): Promise<void> {
    await this.#attempt(async () => (this.recordings = await this.api.recordings(this.id)));
  }

  /** The list of curves changes with every message; a person reads it a few times a second. */
  #listSoon(): void {
    this.#listTimer ??= setTimeout(() => {
      this.#listTimer = undefined;
      this.scanned = this.live.curves.size > 0;
      const listed = this.scanned ? this.live : this.network;
      this.curves = [...listed.curves.values()].map((curve) => ({
        index: curve.index,
        boundary: curve.boundary,
        closed: curve.closed,
        ended: curve.ended,
        length: polylineLength(curve.points.coordinates),
      }));
      this.nodes = [...listed.nodes.keys()].sort((a, b) => a - b);
    }, LIST_PAUSE);
  }

  /** What a person asked for: an older problem is not theirs any more. */
  async #command(work: () => Promise<unknown>): Promise<void> {
    this.problem = "";
    await this.#attempt(work);
  }

  async #attempt(work: () => Promise<unknown>): Promise<void> {
    try {
      await work();
    } catch (error) {
      this.problem = inWords(error);
    }
  }
}

/** Whether a reconstruction has not ended yet. */
export function isBusy(reconstruction: Reconstruction): boolean {
  return reconstruction.state === "queued" || reconstruction.state === "running";
}

function nowIs(flag: CurveFlag, value: boolean): string {
  if (flag === "boundary") return value ? "made boundary" : "made interior";
  if (flag === "closed") return value ? "closed" : "opened";
  return value ? "removed" : "brought back";
}

/** An error in words for the person in front of the screen. */
export function inWords(error: unknown): string {
  if (error instanceof ApiProblem) return error.message;
  if (error instanceof TypeError) return "The server does not answer. Is it running?";
  return error instanceof Error ? error.message : String(error);
}
