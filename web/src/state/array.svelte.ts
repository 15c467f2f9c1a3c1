import type { LiveReading } from "../wire.gen";
import { Latest } from "./latest";
import { Network } from "./network";

/** What the readings of an array need of the session that they are in. */
export interface ArrayHost {
  fetch(number: number): Promise<LiveReading>;
  /** Whether this recording's device is there. */
  isLive(recording: string): boolean;
  /** Another reading is shown; `outdates`: what was made of the one before is not wanted any more. */
  changed(outdates: boolean): void;
  failed(error: unknown): void;
}

/** The readings of a fixed array of sensors: each is a whole network, and one of them is shown. */
export class ArrayStore {
  /** The reading that is shown; undefined while the session has none. */
  shown = $state.raw<LiveReading>();
  /** How many there are. */
  count = $state(0);
  /** The reading that a person chose; undefined: the newest. */
  chosen = $state<number>();
  network = new Network();
  readonly #fetching = new Latest((number: number) => this.#fetch(number));

  constructor(private readonly host: ArrayHost) {}

  /** The array was read: shown unless a person looks at another reading, or another array is there. */
  hear(reading: LiveReading): void {
    const { shown } = this;
    if (shown && shown.recording !== reading.recording && this.host.isLive(shown.recording)) return;
    const fresh = this.count > 0 && reading.number >= this.count;
    this.count = Math.max(this.count, reading.number + 1);
    if (this.chosen === undefined) this.#show(reading, fresh);
  }

  /** Show a reading, or follow the newest again. */
  choose(number: number | undefined): void {
    this.chosen = number;
    void this.#fetching.want(number ?? this.count - 1);
  }

  /** Stay with the reading that is shown, whatever comes. */
  hold(): void {
    this.chosen = this.shown?.number;
  }

  async #fetch(number: number): Promise<void> {
    try {
      this.#show(await this.host.fetch(number), true);
    } catch (error) {
      this.host.failed(error);
    }
  }

  #show(reading: LiveReading, outdates: boolean): void {
    this.shown = reading;
    this.network = new Network();
    this.network.apply({ type: "live.network", curves: reading.curves, nodes: reading.nodes });
    this.host.changed(outdates);
  }
}
