import { describe, expect, it } from "vitest";
import type { Hello } from "../wire.gen";
import type { Recorded, RecordingState, Spool } from "./spool";
import { Uplink } from "./uplink";

/** A spool that forgets with the test. */
class MemorySpool implements Spool {
  messages: Recorded[] = [];
  kept: RecordingState | undefined;

  state = (): Promise<RecordingState | undefined> => Promise.resolve(this.kept);
  append = (message: Recorded, state: RecordingState): Promise<void> => {
    this.messages.push(message);
    this.kept = state;
    return Promise.resolve();
  };
  from = (seq: number, limit: number): Promise<Recorded[]> =>
    Promise.resolve(this.messages.filter((m) => m.seq >= seq).slice(0, limit));
  forgetBefore = (seq: number): Promise<void> => {
    this.messages = this.messages.filter((m) => m.seq >= seq);
    return Promise.resolve();
  };
  clear = (): Promise<void> => this.forgetBefore(Infinity);
}

/** A server that stores messages in order and acknowledges when it is told to. */
class FakeServer {
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: string }) => void) | null = null;
  onclose: (() => void) | null = null;
  readonly received: { type: string; seq: number }[] = [];
  send(text: string): void {
    this.received.push(JSON.parse(text) as { type: string; seq: number });
  }
  answer(message: object): Promise<void> {
    this.onmessage?.({ data: JSON.stringify(message) });
    return new Promise((resolve) => setTimeout(resolve));
  }
  close(): void {
    this.onclose?.();
  }
  get seqs(): number[] {
    return this.received.filter((m) => m.type !== "hello").map((m) => m.seq);
  }
}

const hello = { type: "hello", recording: "r" } as Hello;
const message = (seq: number): Recorded => ({ type: "curve.end", seq, curve: 0, closed: false, discard: false });

function setup(count: number) {
  const spool = new MemorySpool();
  spool.messages = Array.from({ length: count }, (_, seq) => message(seq));
  const servers: FakeServer[] = [];
  const retries: (() => void)[] = [];
  const told = { committed: 0, refused: "", states: [] as string[] };
  const surroundings = {
    open: () => {
      const server = new FakeServer();
      servers.push(server);
      return server as unknown as WebSocket;
    },
    later: (task: () => void) => {
      retries.push(task);
      return () => undefined;
    },
  };
  const uplink = new Uplink("ws://x", hello, spool, {
    state: (state) => told.states.push(state),
    committed: (seq) => (told.committed = seq),
    refused: (words) => (told.refused = words),
  }, surroundings);
  const server = (): FakeServer => servers.at(-1) as FakeServer;
  const open = async (next: number): Promise<void> => {
    server().onopen?.();
    await server().answer({ type: "welcome", version: 1, session: "s", next_seq: next });
  };
  return { spool, servers, server, open, retries, told, uplink };
}

describe("Uplink", () => {
  it("says hello, sends in order and forgets only what is committed", async () => {
    const { spool, server, open, told } = setup(3);
    await open(0);
    expect(server().received[0]).toEqual(hello);
    expect(server().seqs).toEqual([0, 1, 2]);
    expect(spool.messages).toHaveLength(3);
    await server().answer({ type: "ack", seq: 1 });
    expect(spool.messages.map((m) => m.seq)).toEqual([2]);
    expect(told.committed).toBe(2);
  });

  it("sends what comes later, once", async () => {
    const { spool, server, open, uplink } = setup(1);
    await open(0);
    spool.messages.push(message(1));
    await Promise.all([uplink.wake(), uplink.wake()]);
    expect(server().seqs).toEqual([0, 1]);
  });

  it("goes on where the server wants it after the connection was lost", async () => {
    const { server, servers, open, retries, told } = setup(4);
    await open(0);
    server().close();
    expect(told.states.at(-1)).toBe("waiting");
    retries[0]?.();
    await open(2);
    expect(servers).toHaveLength(2);
    expect(server().seqs).toEqual([2, 3]);
  });

  it("never has more on the way than the server can be expected to take", async () => {
    const { server, open } = setup(500);
    await open(0);
    expect(server().seqs).toHaveLength(64);
    await server().answer({ type: "ack", seq: 9 });
    expect(server().seqs).toEqual(Array.from({ length: 74 }, (_, seq) => seq));
  });

  it("tells a refusal in the server's words and does not try again", async () => {
    const { server, servers, told, retries } = setup(1);
    server().onopen?.();
    await server().answer({ type: "error", code: "unknown", message: "there is no session s" });
    expect(told.refused).toBe("there is no session s");
    expect([servers.length, retries.length]).toEqual([1, 0]);
  });

  it("tries again when the trouble may pass", async () => {
    const { server, retries } = setup(1);
    await server().answer({ type: "error", code: "storage", message: "disk full" });
    server().close();
    expect(retries).toHaveLength(1);
  });
});
