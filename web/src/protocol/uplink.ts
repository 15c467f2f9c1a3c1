import type { Ack, ErrorMessage, Hello, Welcome } from "../wire.gen";
import { browser, type Connection, type LiveSurroundings, pauseBefore } from "./live";
import type { Spool } from "./spool";

export interface UplinkHandlers {
  state(state: Connection): void;
  /** Everything before this number is durable on the server. */
  committed(seq: number): void;
  /** The server will never take this recording; in its own words. */
  refused(words: string): void;
}

/** Messages on the way that the server has not acknowledged. */
const MOST_IN_FLIGHT = 64;
/** Refusals after which it makes sense to try again: the server's trouble, or ours that a fresh welcome settles. */
const PASSING: ReadonlySet<ErrorMessage["code"]> = new Set(["gap", "limit", "storage"] as const);

/** Sends what is in a spool, in order, and forgets what the server has committed. Connects again by itself and goes on
 * at the number that the server asks for; sending something twice is harmless. */
export class Uplink {
  #socket: WebSocket | undefined;
  #cancelRetry = (): void => undefined;
  #attempt = 0;
  #ended = false;
  #next: number | undefined;
  #committed = 0;
  #pumping: Promise<void> = Promise.resolve();

  constructor(
    private readonly url: string,
    private readonly hello: Hello,
    private readonly spool: Spool,
    private readonly handlers: UplinkHandlers,
    private readonly surroundings: LiveSurroundings = browser,
  ) {
    this.#connect();
  }

  /** There is something new in the spool. */
  wake(): Promise<void> {
    this.#pumping = this.#pumping.then(() => this.#pump());
    return this.#pumping;
  }

  close(): void {
    this.#ended = true;
    this.#cancelRetry();
    this.#socket?.close();
    this.handlers.state("closed");
  }

  #connect(): void {
    this.#next = undefined;
    this.handlers.state("connecting");
    const socket = this.surroundings.open(this.url);
    this.#socket = socket;
    socket.onopen = () => socket.send(JSON.stringify(this.hello));
    socket.onmessage = (event: MessageEvent<string>) => void this.#receive(event.data);
    socket.onclose = () => this.#lost();
  }

  async #receive(text: string): Promise<void> {
    const message = JSON.parse(text) as Welcome | Ack | ErrorMessage;
    if (message.type === "error") return this.#refused(message);
    this.#attempt = 0;
    if (message.type === "welcome") {
      this.#next = message.next_seq;
      this.handlers.state("open");
    }
    this.#committed = message.type === "welcome" ? message.next_seq : message.seq + 1;
    await this.spool.forgetBefore(this.#committed);
    this.handlers.committed(this.#committed);
    await this.wake();
  }

  async #pump(): Promise<void> {
    const [socket, first] = [this.#socket, this.#next];
    const room = first === undefined ? 0 : MOST_IN_FLIGHT - (first - this.#committed);
    if (first === undefined || room <= 0) return;
    const messages = await this.spool.from(first, room);
    if (socket !== this.#socket || this.#next !== first) return;
    for (const message of messages) socket?.send(JSON.stringify(message));
    this.#next = first + messages.length;
  }

  #refused(error: ErrorMessage): void {
    if (PASSING.has(error.code)) return;
    this.close();
    this.handlers.refused(error.message);
  }

  #lost(): void {
    this.#next = undefined;
    if (this.#ended) return;
    this.handlers.state("waiting");
    this.#cancelRetry = this.surroundings.later(() => this.#connect(), pauseBefore(this.#attempt));
    this.#attempt += 1;
  }
}
