import { type Api, ApiProblem, inWords } from "../protocol/api";
import { type Connection, LiveSocket, socketUrl } from "../protocol/live";
import type { ToBrowser } from "../protocol/messages";
import { polylineLength } from "../geometry/vectors";
import type {
  Curve,
  CurveMarks,
  CurveUpdate,
  LiveDevice,
  LiveReading,
  LiveWatchers,
  NetworkProblem,
  Reconstruction,
  ReconstructionParameters,
  RecordingSummary,
  Session,
} from "../wire.gen";
import { ArrayStore } from "./array.svelte";
import { putIn } from "./files";
import { History } from "./history.svelte";
import { Network } from "./network";
import { Latest } from "./latest";
import { newName } from "./names";
import { ParametersStore } from "./parameters.svelte";
import { PresenceStore } from "./presence.svelte";
import { loadResult, type Report, type Result } from "./result";
import { RightsStore } from "./rights.svelte";

/** A curve as the list of curves names it. */
export interface CurveEntry {
  readonly index: number;
  readonly boundary: boolean;
  readonly closed: boolean;
  readonly ended: boolean;
  /** m, as drawn. */
  readonly length: number;
}

/** A change of one curve, as it is stored. */
export interface CurveChange {
  readonly index: number;
  readonly change: Partial<CurveUpdate>;
}

/** What to draw before it is stored: parameters as they are, on some curves other marks. */
type Trial = readonly CurveMarks[];

const LIST_PAUSE = 250;
/** Status of a preview that the same page has overtaken. */
const OVERTAKEN = 409;
/** ms without a word of a running job after which it is asked. */
const SILENCE = 2000;

/** Everything about the session that is open. High-rate data (points) stays outside the reactive graph; `revision`
 * tells those who draw it that it changed. */
export class SessionStore {
  readonly live = new Network();
  readonly history = new History();
  readonly parameters = new ParametersStore();
  readonly presence = new PresenceStore();
  readonly array = new ArrayStore({
    fetch: (number) => this.api.reading(this.id, number),
    isLive: (recording) => this.presence.isLive(recording),
    changed: (outdates) => {
      if (outdates) this.#outdate();
      this.#redraw();
    },
    failed: (error) => (this.problem = inWords(error)),
  });
  session = $state<Session>();
  connection = $state<Connection>("connecting");
  curves = $state.raw<readonly CurveEntry[]>([]);
  nodes = $state.raw<readonly number[]>([]);
  /** Whether the server told what there is. */
  known = $state(false);
  /** Whether curves were scanned here, which may be edited; a network that was opened is as it is in its file. */
  scanned = $state(false);
  readonly rights = new RightsStore();
  reconstruction = $state.raw<Reconstruction>();
  result = $state.raw<Result>();
  /** The network with parameters that a hand is moving. */
  preview = $state.raw<{ readonly network: Network; readonly report: Report }>();
  /** What keeps the curves from becoming a surface, as far as they are scanned. */
  problems = $state.raw<readonly NetworkProblem[]>([]);
  /** The curves as the server has them, with their marks. */
  details = $state.raw<readonly Curve[]>([]);
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
  readonly #previews = new Latest((trial: Trial) => this.#try(trial));
  readonly #checks = new Latest(() => this.#check());
  /** Whether the surface follows edits, as it does from the first one on until more is scanned. */
  #follows = false;
  /** Whether the result is older than an edit. */
  #stale = false;
  /** Whether somebody points at curves. */
  #pointed = false;
  #detailsTimer: ReturnType<typeof setTimeout> | undefined;
  #listTimer: ReturnType<typeof setTimeout> | undefined;
  #progressTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    readonly api: Api,
    readonly id: string,
  ) {}

  /** True while a curve is being scanned. */
  get scanning(): boolean {
    return this.curves.some((curve) => !curve.ended);
  }

  /** What is drawn: the preview while parameters are moved, else the reconstructed network once there is one and
   * nothing was scanned since, else the live one. */
  get network(): Network {
    return this.preview?.network ?? this.result?.network ?? (this.ofArray ? this.array.network : this.live);
  }

  /** Whether a fixed array is what measures here, and nothing was scanned. */
  get ofArray(): boolean {
    return this.array.shown !== undefined && this.live.curves.size === 0;
  }

  async open(): Promise<void> {
    await this.#attempt(async () => {
      [this.session] = await Promise.all([this.api.session(this.id), this.rights.load(this.api)]);
      const url = socketUrl(`/api/v1/sessions/${this.id}/live`, location);
      this.#socket = new LiveSocket(url, { message: (m) => this.receive(m), state: (s) => (this.connection = s) });
      const latest = this.session.latest_reconstruction;
      if (latest) await this.#show(await this.api.reconstruction(latest));
    });
  }

  close(): void {
    clearTimeout(this.#listTimer);
    clearTimeout(this.#detailsTimer);
    clearTimeout(this.#progressTimer);
    this.#socket?.close();
  }

  receive(message: ToBrowser): void {
    switch (message.type) {
      case "live.device":
        return this.presence.hear(message);
      case "live.watchers":
        return void (this.presence.watchers = message.count);
      case "live.reconstruction":
        this.#progressed(message.reconstruction);
        break;
      case "live.reading":
        this.array.hear(message);
        break;
      default:
        this.#fold(message);
    }
  }

  async rename(name: string): Promise<void> {
    await this.command(async () => (this.session = await this.api.renameSession(this.id, name)));
  }

  /** Take in files as if devices had sent them. */
  async upload(files: readonly File[]): Promise<void> {
    await this.command(async () => {
      for (const file of files) await putIn(this.api, this.id, file);
      this.#outdate();
    });
  }

  /** Begin a reconstruction with the parameters as they are; one that is under way is not wanted any more. */
  async reconstruct(): Promise<void> {
    const before = this.reconstruction;
    this.array.hold();
    const request = this.#wish();
    await this.command(async () => this.#progressed(await this.api.reconstruct(this.id, request)));
    if (before && isBusy(before)) await this.api.cancel(before.id).catch(() => undefined);
  }

  /** Draw the network with the parameters as they are as soon as it can be had; only the newest wish counts. */
  tryOut(marks: Trial = []): void {
    void this.#previews.want(marks);
  }

  /** Draw a network whose points know their samples, so that its curves can be pointed at. */
  needSamples(): void {
    this.#pointed = true;
    if (this.scanned && !this.preview && this.result) this.tryOut();
  }

  async cancel(): Promise<void> {
    const { reconstruction } = this;
    if (reconstruction) await this.command(async () => this.#progressed(await this.api.cancel(reconstruction.id)));
  }

  /** Store these changes of curves. */
  async write(changes: readonly CurveChange[]): Promise<void> {
    for (const { index, change } of changes) await this.api.updateCurve(this.id, index, change);
    await this.#listDetails();
    this.#edited();
  }

  /** What the server knows of a curve. */
  detailsOf(curve: number): Curve | undefined {
    return this.details.find(({ index }) => index === curve);
  }

  async undo(): Promise<void> {
    await this.command(() => this.history.undo());
  }

  async redo(): Promise<void> {
    await this.command(() => this.history.redo());
  }

  /** The parameters as they are, and the reading that they are for. */
  #wish(): Partial<ReconstructionParameters> {
    const { request } = this.parameters;
    const { shown } = this.array;
    return this.ofArray && shown ? { ...request, reading: shown.number } : request;
  }

  #fold(message: Exclude<ToBrowser, LiveDevice | LiveReading | LiveWatchers | { type: "live.reconstruction" }>): void {
    const change = this.live.apply(message);
    if (change === "gap") return this.#socket?.restart();
    if (message.type === "live.snapshot" || message.type === "live.curve.start") void this.#listRecordings();
    if (message.type !== "live.points") this.#detailsSoon();
    if (message.type === "live.snapshot") {
      this.known = true;
      this.presence.hear(...message.devices);
      this.presence.watchers = message.watchers;
      for (const reading of message.readings) this.array.hear(reading);
      if (message.reconstruction) this.#progressed(message.reconstruction);
    }
    if (message.type === "live.curve.start" || message.type === "live.points") this.#outdate();
    this.#listSoon();
    if (this.network !== this.live) return;
    if (change === "replaced") this.replacements += 1;
    this.revision += 1;
  }

  #progressed(reconstruction: Reconstruction): void {
    if (this.reconstruction && reconstruction.created < this.reconstruction.created) return;
    this.reconstruction = reconstruction;
    clearTimeout(this.#progressTimer);
    if (isBusy(reconstruction)) this.#progressTimer = setTimeout(() => void this.#ask(reconstruction.id), SILENCE);
    if (this.#stale && (reconstruction.state === "failed" || reconstruction.state === "cancelled")) this.#dropResult();
    if (reconstruction.state === "done") void this.#attempt(() => this.#show(reconstruction));
  }

  /** The surface is that of curves which are not so any more. */
  #dropResult(): void {
    if (!this.result) return;
    this.result = undefined;
    this.#redraw();
  }

  /** The live path may drop what it has to say, so a job that is silent is asked. */
  async #ask(id: string): Promise<void> {
    await this.#attempt(async () => this.#progressed(await this.api.reconstruction(id)));
  }

  async #show(reconstruction: Reconstruction): Promise<void> {
    if (this.#loading === reconstruction.id) return;
    this.#loading = reconstruction.id;
    this.reconstruction ??= reconstruction;
    const named = this.ofArray ? [...this.array.network.nodes.keys()] : undefined;
    const result = await loadResult(this.api, reconstruction, named);
    if (this.#loading !== reconstruction.id) return;
    this.result = result;
    this.#stale = false;
    this.preview = undefined;
    this.#redraw();
    if (this.#pointed) this.needSamples();
  }

  async #try(marks: Trial): Promise<void> {
    try {
      const wish = { ...this.#wish(), marks: [...marks] };
      const { curves, nodes, report } = await this.api.preview(this.id, this.#client, wish);
      const network = new Network();
      network.apply({ type: "live.network", curves, nodes });
      this.preview = { network, report: { network: report } };
      this.problem = "";
    } catch (error) {
      if (error instanceof ApiProblem && error.status === OVERTAKEN) return;
      // Where the parameters are not to blame, the list of problems says it better.
      if (!this.parameters.isDefault || !(error instanceof ApiProblem)) this.problem = inWords(error);
      this.preview = undefined;
      if (this.#stale) this.result = undefined;
    }
    this.#redraw();
  }

  /** Curves or marks were changed: draw the network that they give, and let the surface follow if there was one. */
  #edited(): void {
    if (this.scanning) return;
    this.#follows ||= this.result !== undefined || (this.reconstruction !== undefined && isBusy(this.reconstruction));
    this.#stale = true;
    this.tryOut();
    if (this.#follows) void this.reconstruct();
  }

  /** Points were scanned that no result has: show what is live. */
  #outdate(): void {
    this.#follows = false;
    if (!this.result && !this.preview) return;
    this.result = this.preview = undefined;
    this.#redraw();
  }

  #redraw(): void {
    this.replacements += 1;
    this.revision += 1;
    this.#listSoon();
  }

  /** Choose the calibration of a recording's device that corrects it, "" for none. */
  async calibrate(recording: string, version: string): Promise<void> {
    await this.#attempt(async () => {
      await this.api.calibrate(this.id, recording, version ? Number(version) : null);
      await this.#listRecordings();
      this.#edited();
    });
  }

  async #listRecordings(): Promise<void> {
    await this.#attempt(async () => (this.recordings = await this.api.recordings(this.id)));
  }

  async #listDetails(): Promise<void> {
    await this.#attempt(async () => {
      this.details = await this.api.curves(this.id);
      void this.#checks.want(undefined);
    });
  }

  /** A curve that is being scanned has ends that meet nothing yet. */
  async #check(): Promise<void> {
    const ready = this.details.length > 0 && this.details.every(({ ended }) => ended);
    if (!ready) return void (this.problems = []);
    await this.#attempt(async () => (this.problems = (await this.api.problems(this.id)).problems));
    if (this.problems.length) this.needSamples();
  }

  #detailsSoon(): void {
    this.#detailsTimer ??= setTimeout(() => {
      this.#detailsTimer = undefined;
      void this.#listDetails();
    }, LIST_PAUSE);
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
  async command(work: () => Promise<unknown>): Promise<void> {
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
