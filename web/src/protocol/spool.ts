import { type DBSchema, type IDBPDatabase, openDB } from "idb";
import type { CurveEnd, CurveStart, Device, NodeMark, Samples } from "../wire.gen";

type Columns = Pick<Samples, "type" | "seq" | "curve" | "first_sample"> & {
  readonly [name in "time" | "quaternion" | "ticks" | "acceleration" | "magnetic"]?: NonNullable<Samples[name]>;
};

/** What a page sends about a scan. */
export type Recorded = CurveStart | CurveEnd | NodeMark | Columns;

/** Where a recording stands; kept with its messages, so that a reload goes on where the page was left. */
export interface RecordingState {
  readonly recording: string;
  readonly device: Device;
  readonly nextSeq: number;
  readonly nextCurve: number;
  /** Number of the curve being scanned, if there is one, and of its samples so far. */
  readonly openCurve: number | null;
  readonly samples: number;
}

/** Keeps messages until the server has committed them. */
export interface Spool {
  /** The state as of the last message; undefined for a new recording. */
  state(): Promise<RecordingState | undefined>;
  /** Keep a message and the state that it leads to, both or neither. */
  append(message: Recorded, state: RecordingState): Promise<void>;
  /** At most `limit` messages from number `seq` on, in order. */
  from(seq: number, limit: number): Promise<Recorded[]>;
  /** Everything before number `seq` is durable elsewhere. */
  forgetBefore(seq: number): Promise<void>;
  /** Start from nothing: the recording is finished. */
  clear(): Promise<void>;
}

interface Schema extends DBSchema {
  messages: { key: number; value: Recorded };
  state: { key: "state"; value: RecordingState };
}

/** A spool in the browser's database: survives a reload, a crash and an empty battery. */
export class DurableSpool implements Spool {
  readonly #database: Promise<IDBPDatabase<Schema>>;

  constructor(session: string) {
    this.#database = openDB<Schema>(`tracemesh-${session}`, 1, {
      upgrade: (database) => {
        database.createObjectStore("messages", { keyPath: "seq" });
        database.createObjectStore("state");
      },
    });
  }

  async state(): Promise<RecordingState | undefined> {
    return (await this.#database).get("state", "state");
  }

  async append(message: Recorded, state: RecordingState): Promise<void> {
    const both = (await this.#database).transaction(["messages", "state"], "readwrite", { durability: "strict" });
    await Promise.all([
      both.objectStore("messages").put(message),
      both.objectStore("state").put(state, "state"),
      both.done,
    ]);
  }

  async from(seq: number, limit: number): Promise<Recorded[]> {
    return (await this.#database).getAll("messages", IDBKeyRange.lowerBound(seq), limit);
  }

  async forgetBefore(seq: number): Promise<void> {
    await (await this.#database).delete("messages", IDBKeyRange.upperBound(seq, true));
  }

  async clear(): Promise<void> {
    const both = (await this.#database).transaction(["messages", "state"], "readwrite");
    await Promise.all([both.objectStore("messages").clear(), both.objectStore("state").clear(), both.done]);
  }
}
