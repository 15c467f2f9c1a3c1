import type { Reading } from "../protocol/source";
import type { Recorded, RecordingState, Spool } from "../protocol/spool";
import type { Device } from "../wire.gen";

/** Samples in one message. */
const BLOCK = 15;

/** Turns readings and taps into the numbered messages of one recording, in the order in which they happened. */
export class Recorder {
  #pending: Reading[] = [];
  #writing: Promise<void> = Promise.resolve();

  /** `stored` is called whenever the spool has something new. */
  constructor(
    private readonly spool: Spool,
    private current: RecordingState,
    private readonly stored: () => void,
  ) {}

  /** Go on with a recording; a curve that a reload interrupted is ended. */
  static async resume(spool: Spool, state: RecordingState, stored: () => void): Promise<Recorder> {
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
    return this.#keep({ type: "curve.start", seq: this.current.nextSeq, curve, boundary }, {
      nextCurve: curve + 1,
      openCurve: curve,
      samples: 0,
    });
  }

  /** One reading; kept in blocks. */
  async add(reading: Reading): Promise<void> {
    if (this.current.openCurve === null) return;
    this.#pending.push(reading);
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
    const message = { type: "samples", seq, curve, first_sample: samples, ...columnsOf(block) } as const;
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

/** A recording with nothing in it. */
export function freshRecording(recording: string, device: Device): RecordingState {
  return { recording, device, nextSeq: 0, nextCurve: 0, openCurve: null, samples: 0 };
}

/** Readings side by side: one column for each thing that was measured. */
function columnsOf(block: readonly Reading[]): Record<string, unknown[]> {
  const names = Object.keys(block[0] ?? {}) as (keyof Reading)[];
  return Object.fromEntries(names.map((name) => [name, block.map((reading) => reading[name])]));
}
