import { continued, type Quaternion } from "../geometry/orientation";
import type { Reading } from "../protocol/sensors";
import type { Recorded, RecordingState, Spool } from "../protocol/spool";

/** Samples in one message. */
const BLOCK = 15;

/** Turns readings and taps into the numbered messages of one recording, in the order in which they happened. */
export class Recorder {
  #pending: Reading[] = [];
  #before: Quaternion | undefined;
  #writing: Promise<void> = Promise.resolve();

  /** `stored` is called whenever the spool has something new. */
  constructor(
    private readonly spool: Spool,
    private current: RecordingState,
    private readonly stored: () => void,
  ) {}

  /** Go on with the recording in a spool, or begin one; a curve that a reload interrupted is ended. */
  static async resume(spool: Spool, fresh: () => string, stored: () => void): Promise<Recorder> {
    const state = (await spool.state()) ?? empty(fresh());
    const recorder = new Recorder(spool, state, stored);
    if (state.openCurve !== null) await recorder.end(false);
    return recorder;
  }

  get state(): RecordingState {
    return this.current;
  }

  /** Samples of the open curve, those that are not stored yet included. */
  get samples(): number {
    return this.current.samples + this.#pending.length;
  }

  start(boundary: boolean): Promise<void> {
    const curve = this.current.nextCurve;
    this.#before = undefined;
    return this.#keep({ type: "curve.start", seq: this.current.nextSeq, curve, boundary }, {
      nextCurve: curve + 1,
      openCurve: curve,
      samples: 0,
    });
  }

  /** One reading; kept in blocks. */
  async add(reading: Reading): Promise<void> {
    if (this.current.openCurve === null) return;
    const orientation = continued(reading.orientation, this.#before);
    this.#before = orientation;
    this.#pending.push({ time: reading.time, orientation });
    if (this.#pending.length >= BLOCK) await this.flush();
  }

  /** Mark a node, or take the mark back, at a sample of the open curve; the newest by default. */
  async mark(node: number, sample = this.samples - 1, undo = false): Promise<number> {
    await this.flush();
    const curve = this.current.openCurve;
    if (curve === null || sample < 0) throw new Error("A node is marked on a curve that has begun.");
    await this.#keep({ type: "node", seq: this.current.nextSeq, curve, sample, node, undo }, {});
    return sample;
  }

  /** End the open curve; `discard`: it was a mistake. */
  async end(closed: boolean, discard = false): Promise<void> {
    await this.flush();
    const curve = this.current.openCurve;
    if (curve === null) return;
    const message = { type: "curve.end", seq: this.current.nextSeq, curve, closed, discard } as const;
    await this.#keep(message, { openCurve: null, samples: 0 });
  }

  /** Put the readings so far into the spool. */
  async flush(): Promise<void> {
    const block = this.#pending;
    const { openCurve: curve, samples, nextSeq: seq } = this.current;
    if (curve === null || block.length === 0) return this.#writing;
    this.#pending = [];
    const columns = { time: block.map((r) => r.time), quaternion: block.map((r) => r.orientation) };
    const message = { type: "samples", seq, curve, first_sample: samples, ...columns } as const;
    await this.#keep(message, { samples: samples + block.length });
  }

  #keep(message: Recorded, change: Partial<RecordingState>): Promise<void> {
    const state = { ...this.current, ...change, nextSeq: message.seq + 1 };
    this.current = state;
    this.#writing = this.#writing.then(async () => {
      await this.spool.append(message, state);
      this.stored();
    });
    return this.#writing;
  }
}

function empty(recording: string): RecordingState {
  return { recording, nextSeq: 0, nextCurve: 0, openCurve: null, samples: 0 };
}
