import { describe, expect, it } from "vitest";
import vectors from "./framing.vectors.json";
import { morphorider, type SerialPort } from "./serial";
import type { Reading, StopSource } from "./source";

const good = Uint8Array.from(vectors[0]?.hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));

/** A device that answers the n-th request with what `answer` says. */
class FakePort implements SerialPort {
  requests = 0;
  #controller: ReadableStreamDefaultController<Uint8Array> | undefined;
  readonly readable = new ReadableStream<Uint8Array>({ start: (controller) => void (this.#controller = controller) });
  readonly writable = new WritableStream<Uint8Array>({ write: (bytes) => this.#asked(bytes) });

  constructor(private readonly answer: (request: number) => readonly Uint8Array[]) {}

  open = (): Promise<void> => Promise.resolve();
  close = (): Promise<void> => Promise.resolve();

  #asked(bytes: Uint8Array): void {
    expect([...bytes]).toEqual(["Q".charCodeAt(0)]);
    for (const piece of this.answer(this.requests++)) this.#controller?.enqueue(piece);
  }
}

async function readings(port: SerialPort, count: number): Promise<Reading[]> {
  const found: Reading[] = [];
  const window = { navigator: { serial: { requestPort: () => Promise.resolve(port) } } } as unknown as Window;
  let stop: StopSource = () => undefined;
  await new Promise<void>((resolve, reject) => {
    const handlers = {
      reading: (reading: Reading) => {
        found.push(reading);
        if (found.length === count) resolve();
      },
      failed: (words: string) => reject(new Error(words)),
    };
    void morphorider.start(window, handlers).then((stopper) => (stop = stopper), reject);
  });
  stop();
  return found;
}

describe("morphorider", () => {
  it("asks once for each frame and passes on what it measured", async () => {
    const port = new FakePort(() => [good.slice(0, 5), good.slice(5)]);
    const found = await readings(port, 3);
    const { ticks, ...rest } = vectors[0]?.frame ?? {};
    expect(found[0]).toEqual({ time: expect.any(Number) as number, ticks, ...rest });
    expect(port.requests).toBe(3);
  });

  it("is in step again after short, long and senseless answers", async () => {
    const broken = [good.slice(0, 9), Uint8Array.of(...good, 1, 2, 3), new Uint8Array(22)];
    const port = new FakePort((request) => [broken[request] ?? good]);
    const found = await readings(port, 3);
    expect(port.requests).toBe(broken.length - 1 + found.length);
  });

  it("says when the person chose no port", async () => {
    const window = { navigator: { serial: { requestPort: () => Promise.reject(new Error("x")) } } } as unknown as Window;
    const words: string[] = [];
    await morphorider.start(window, { reading: () => undefined, failed: (said) => words.push(said) });
    expect(words).toEqual(["No port was chosen."]);
  });
});
