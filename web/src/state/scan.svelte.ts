import { type Api, inWords } from "../protocol/api";
import { type Connection, LiveSocket, socketUrl } from "../protocol/live";
import type { Reading, Source, StopSource } from "../protocol/source";
import { DurableSpool, type RecordingState } from "../protocol/spool";
import { Uplink } from "../protocol/uplink";
import type { Hello } from "../wire.gen";
import { mergedNumbers, Network } from "./network";
import { newName } from "./names";
import { freshRecording, Recorder } from "./recorder";

const READINGS_INTERVAL = 500;
const BUZZ = 40;

/** Samples of which a stroke has at least this many; fewer are a tap by mistake. */
const LEAST_STROKE = 10;
const NO_WAKE_LOCK = "Switch the automatic screen lock off: this browser cannot keep the screen on.";

/** Where a stroke begins or ends: a node, a new one (undefined), or where it began. */
export type StrokeEnd = number | "start" | undefined;

interface Mark {
  readonly node: number;
  readonly sample: number;
}

/** A page that is a scanning device: its source of readings, its recording and the way to the server. */
export class ScanStore {
  readonly network = new Network();
  name = $state("");
  /** Counts changes of the drawn network. */
  revision = $state(0);
  connection = $state<Connection>("closed");
  /** Kind of the device that the recording in the spool is from. */
  kind = $state<string>();
  sensing = $state(false);
  scanning = $state(false);
  /** Number of the curve being scanned, or of the next one; from 1. */
  curve = $state(1);
  boundary = $state(true);
  closed = $state(false);
  /** The node that the next mark names; undefined: a new one. */
  node = $state<StrokeEnd>();
  nodes = $state.raw<readonly number[]>([]);
  /** Shapes are drawn in the air, a stroke while a finger is held down, instead of led along a surface. */
  sketching = $state(false);
  /** Nodes at which the next stroke begins and ends. */
  from = $state<StrokeEnd>();
  to = $state<StrokeEnd>();
  marks = $state.raw<readonly Mark[]>([]);
  /** Readings per second, as measured. */
  rate = $state(0);
  samples = $state(0);
  /** Messages that the server has not committed. */
  waiting = $state(0);
  problem = $state("");
  /** What a person should see to, because the browser does not. */
  advice = $state("");
  readonly #spool: DurableSpool;
  #recorder: Recorder | undefined;
  #uplink: Uplink | undefined;
  #live: LiveSocket | undefined;
  #stopSource: StopSource = () => undefined;
  #wakeLock: WakeLockSentinel | undefined;
  #opened: Promise<void> = Promise.resolve();
  #committed = 0;
  #readings = 0;
  #timer: ReturnType<typeof setInterval> | undefined;

  constructor(
    private readonly api: Api,
    readonly session: string,
    private readonly window: Window,
  ) {
    this.#spool = new DurableSpool(session);
  }

  /** Open the session: what an earlier visit left in the spool is sent at once. */
  open(): Promise<void> {
    this.#opened = this.#open();
    return this.#opened;
  }

  async #open(): Promise<void> {
    try {
      this.name = (await this.api.session(this.session)).name;
    } catch (error) {
      this.problem = inWords(error);
      return;
    }
    const { location } = this.window;
    const state = await this.#spool.state();
    if (state) await this.#resume(state);
    this.#live = new LiveSocket(socketUrl(`/api/v1/sessions/${this.session}/live`, location), {
      message: (message) => this.#draw(this.network.apply(message)),
      state: () => undefined,
    });
    this.#timer = setInterval(() => this.#measure(), READINGS_INTERVAL);
  }

  close(): void {
    clearInterval(this.#timer);
    this.#stopSource();
    void this.#wakeLock?.release();
    this.#uplink?.close();
    this.#live?.close();
  }

  /** Read this source; from a tap. */
  async use(source: Source): Promise<void> {
    this.problem = source.missing(this.window);
    if (this.problem) return;
    this.#stopSource();
    this.#stopSource = await source.start(this.window, {
      reading: (reading) => this.#take(reading),
      failed: (words) => {
        this.sensing = false;
        this.problem = words;
        void this.#wakeLock?.release();
      },
    });
    await this.#opened;
    const id = newName(source.kind);
    if (!this.#recorder) await this.#resume(freshRecording(id, { id, ...source.device }));
  }

  /** Keep the screen on while sensors are read: a dark screen stops them. */
  async stayAwake(): Promise<void> {
    const { navigator, document } = this.window;
    if (document.visibilityState !== "visible") return;
    this.#wakeLock = await navigator.wakeLock?.request("screen").catch(() => undefined);
    this.advice = this.#wakeLock ? "" : NO_WAKE_LOCK;
  }

  async start(): Promise<void> {
    if (!this.#recorder || this.scanning) return;
    this.marks = [];
    this.scanning = true;
    await this.#recorder.start(!this.sketching && this.boundary);
  }

  async stop(): Promise<void> {
    await this.#end(false);
  }

  async mark(): Promise<void> {
    const recorder = this.#recorder;
    if (!recorder || recorder.samples === 0) return;
    const node = typeof this.node === "number" ? this.node : this.newNode;
    const sample = await recorder.mark(node);
    this.marks = [...this.marks, { node, sample }];
    this.nodes = mergedNumbers(this.nodes, [node]);
    this.node = undefined;
    this.window.navigator.vibrate?.(BUZZ);
  }

  /** Take back the last mark of the open curve; without one, the curve itself. */
  async undo(): Promise<void> {
    const last = this.marks.at(-1);
    if (!last) return this.#end(true);
    this.marks = this.marks.slice(0, -1);
    await this.#recorder?.mark(last.node, last.sample, true);
  }

  /** End a stroke: both of its ends are nodes, and the next one goes on at the second. */
  async lift(): Promise<void> {
    const recorder = this.#recorder;
    if (!recorder || !this.scanning) return;
    if (recorder.samples < LEAST_STROKE) return this.#end(true);
    const last = recorder.samples - 1;
    const start = typeof this.from === "number" ? this.from : this.newNode;
    this.nodes = mergedNumbers(this.nodes, [start]);
    const end = this.to === "start" ? start : (this.to ?? this.newNode);
    this.nodes = mergedNumbers(this.nodes, [end]);
    this.closed = start === end;
    [this.from, this.to] = [end, undefined];
    await recorder.mark(start, 0);
    await recorder.mark(end, last);
    await this.#end(false);
    this.window.navigator.vibrate?.(BUZZ);
  }

  /** Take back the last curve that this recording has. */
  async removeLast(): Promise<void> {
    try {
      const { recording } = this.#recorder?.state ?? {};
      const last = (await this.api.curves(this.session)).filter((curve) => curve.recording === recording).at(-1);
      if (last) await this.api.updateCurve(this.session, last.index, { removed: true });
    } catch (error) {
      this.problem = inWords(error);
    }
  }

  /** The recording is finished; false while something is still on its way. */
  async finish(): Promise<boolean> {
    if (this.scanning || this.waiting > 0) return false;
    this.close();
    await this.#spool.clear();
    return true;
  }

  /** The number that a new node gets. */
  get newNode(): number {
    return Math.max(-1, ...this.nodes, ...this.network.nodes.keys()) + 1;
  }

  async #resume(state: RecordingState): Promise<void> {
    const recorder = await Recorder.resume(this.#spool, state, () => this.#stored());
    this.#recorder = recorder;
    this.kind = state.device.kind;
    this.curve = recorder.state.nextCurve + 1;
    const { recording, device } = state;
    const hello: Hello = { type: "hello", versions: [1], recording, session: this.session, device };
    this.#uplink = new Uplink(socketUrl("/api/v1/ingest", this.window.location), hello, this.#spool, {
      state: (connection) => (this.connection = connection),
      committed: (seq) => this.#commit(seq),
      refused: (words) => (this.problem = words),
    });
  }

  async #end(discard: boolean): Promise<void> {
    this.scanning = false;
    this.marks = [];
    await this.#recorder?.end(this.closed, discard);
    this.curve = (this.#recorder?.state.nextCurve ?? 0) + 1;
    this.boundary = false;
    this.closed = false;
    this.samples = 0;
  }

  #take(reading: Reading): void {
    this.#readings += 1;
    if (!this.sensing) void this.stayAwake();
    this.sensing = true;
    void this.#recorder?.add(reading);
  }

  #measure(): void {
    this.rate = (1000 * this.#readings) / READINGS_INTERVAL;
    this.#readings = 0;
    this.samples = this.#recorder?.samples ?? 0;
  }

  #stored(): void {
    this.#count();
    void this.#uplink?.wake();
  }

  #commit(seq: number): void {
    this.#committed = seq;
    this.#count();
  }

  #count(): void {
    this.waiting = Math.max(0, (this.#recorder?.state.nextSeq ?? 0) - this.#committed);
  }

  #draw(change: string): void {
    if (change === "gap") this.#live?.restart();
    this.nodes = mergedNumbers(this.nodes, this.network.nodes.keys());
    this.revision += 1;
  }
}
