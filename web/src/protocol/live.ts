import { parseLive, type ToBrowser } from "./messages";

export type Connection = "connecting" | "open" | "waiting" | "closed";

export interface LiveHandlers {
  message(message: ToBrowser): void;
  state(state: Connection): void;
}

/** The two things that a test replaces: how a socket is opened and how time passes. */
export interface LiveSurroundings {
  open(url: string): WebSocket;
  later(task: () => void, milliseconds: number): () => void;
}

export const browser: LiveSurroundings = {
  open: (url) => new WebSocket(url),
  later: (task, milliseconds) => {
    const handle = setTimeout(task, milliseconds);
    return () => clearTimeout(handle);
  },
};

const FIRST_PAUSE = 250;
const LONGEST_PAUSE = 8000;
/** Close code that tells that the session was deleted. */
const SESSION_GONE = 4404;
/** Close code that tells that the token was revoked or has expired. */
const TOKEN_ENDED = 4401;

/** Pause before the n-th attempt to connect again, ms. */
export function pauseBefore(attempt: number): number {
  return Math.min(FIRST_PAUSE * 2 ** attempt, LONGEST_PAUSE);
}

/** The live socket of one session: connects again by itself until it is closed. The snapshot that comes first makes
 * every new connection complete, so nothing needs to be asked for again. */
export class LiveSocket {
  #socket: WebSocket | undefined;
  #cancelRetry = (): void => undefined;
  #attempt = 0;
  #closed = false;

  constructor(
    private readonly url: string,
    private readonly handlers: LiveHandlers,
    private readonly surroundings: LiveSurroundings = browser,
  ) {
    this.#connect();
  }

  /** Drop this connection and open a fresh one: asks for a new snapshot. */
  restart(): void {
    this.#socket?.close();
  }

  close(): void {
    this.#closed = true;
    this.#cancelRetry();
    this.#socket?.close();
    this.handlers.state("closed");
  }

  #connect(): void {
    if (this.#attempt === 0) this.handlers.state("connecting");
    const socket = this.surroundings.open(this.url);
    this.#socket = socket;
    socket.onopen = () => this.handlers.state("open");
    socket.onmessage = (event: MessageEvent<string>) => this.#receive(event.data);
    socket.onclose = (event) => this.#lost(event.code);
  }

  #receive(text: string): void {
    this.#attempt = 0;
    const message = parseLive(text);
    if (message) this.handlers.message(message);
  }

  #lost(code: number): void {
    if (this.#closed) return;
    if (code === SESSION_GONE || code === TOKEN_ENDED) return this.close();
    this.handlers.state("waiting");
    this.#cancelRetry = this.surroundings.later(() => this.#connect(), pauseBefore(this.#attempt));
    this.#attempt += 1;
  }
}

/** Absolute WebSocket address of a path on the server that sent this page. */
export function socketUrl(path: string, location: { protocol: string; host: string }): string {
  return `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`;
}
