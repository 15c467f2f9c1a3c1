import { describe, expect, it } from "vitest";
import { type Connection, LiveSocket, pauseBefore, socketUrl } from "./live";
import type { ToBrowser } from "./messages";

class FakeSocket {
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: string }) => void) | null = null;
  onclose: ((event: { code: number }) => void) | null = null;
  close(code = 1006): void {
    this.onclose?.({ code });
  }
}

function setup() {
  const sockets: FakeSocket[] = [];
  const waiting: { task: () => void; milliseconds: number }[] = [];
  const states: Connection[] = [];
  const messages: ToBrowser[] = [];
  const surroundings = {
    open: () => {
      const socket = new FakeSocket();
      sockets.push(socket);
      return socket as unknown as WebSocket;
    },
    later: (task: () => void, milliseconds: number) => {
      const entry = { task, milliseconds };
      waiting.push(entry);
      return () => void waiting.splice(waiting.indexOf(entry), 1);
    },
  };
  const handlers = { message: (m: ToBrowser) => messages.push(m), state: (s: Connection) => states.push(s) };
  const live = new LiveSocket("ws://here/live", handlers, surroundings);
  return { sockets, waiting, states, messages, live };
}

const ended = JSON.stringify({ type: "live.curve.end", index: 0, closed: true });

describe("LiveSocket", () => {
  it("passes on what it knows and ignores what a newer server may add", () => {
    const { sockets, messages, states } = setup();
    sockets[0]?.onopen?.();
    sockets[0]?.onmessage?.({ data: ended });
    sockets[0]?.onmessage?.({ data: '{"type": "live.weather"}' });
    expect(messages.map((message) => message.type)).toEqual(["live.curve.end"]);
    expect(states).toEqual(["connecting", "open"]);
  });

  it("connects again after ever longer pauses, and soon again once something came", () => {
    const { sockets, waiting, states } = setup();
    for (let i = 0; i < 3; i += 1) {
      sockets.at(-1)?.close();
      waiting[i]?.task();
    }
    expect(waiting.map((entry) => entry.milliseconds)).toEqual([250, 500, 1000]);
    sockets.at(-1)?.onmessage?.({ data: ended });
    sockets.at(-1)?.close();
    expect(waiting.at(-1)?.milliseconds).toBe(250);
    expect(states.at(-1)).toBe("waiting");
  });

  it("stays closed once it was closed", () => {
    const { sockets, waiting, states, live } = setup();
    sockets[0]?.close();
    live.close();
    expect(waiting).toEqual([]);
    expect(states.at(-1)).toBe("closed");
    expect(sockets).toHaveLength(1);
  });

  it("gives up when the session is gone", () => {
    const { sockets, waiting, states } = setup();
    sockets[0]?.close(4404);
    expect(waiting).toEqual([]);
    expect(states.at(-1)).toBe("closed");
  });

  it("opens a fresh connection when asked to", () => {
    const { sockets, waiting, live } = setup();
    live.restart();
    waiting[0]?.task();
    expect(sockets).toHaveLength(2);
  });
});

it("never waits longer than eight seconds", () => {
  expect(pauseBefore(40)).toBe(8000);
});

it("uses a secure socket on a secure page", () => {
  expect(socketUrl("/a", { protocol: "https:", host: "h:1" })).toBe("wss://h:1/a");
  expect(socketUrl("/a", { protocol: "http:", host: "h" })).toBe("ws://h/a");
});
