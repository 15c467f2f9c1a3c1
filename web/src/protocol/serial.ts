import { Odometer } from "../geometry/odometer";
import { decodeFrame, FRAME_LENGTH, type Frame, REQUEST, TICKS_PER_TURN } from "./framing";
import { REFERENCE, type Source, type SourceHandlers, type StopSource } from "./source";

/** The part of a Web Serial port that is used. */
export interface SerialPort {
  open(options: { baudRate: number }): Promise<void>;
  close(): Promise<void>;
  readonly readable: ReadableStream<Uint8Array> | null;
  readonly writable: WritableStream<Uint8Array> | null;
}

interface WithSerial {
  readonly serial?: { requestPort(): Promise<SerialPort> };
}

const BAUD_RATE = 115200;
const CIRCUMFERENCE = 0.1;
/** ms between two requests, ms to wait for an answer, ms without a byte after which the device has finished speaking. */
const PERIOD = 1000 / 60;
const PATIENCE = 250;
const QUIET = 30;
/** Silent requests in a row after which the device is lost. */
const MOST_FAULTS = 20;
const LOST = "The Morphorider does not answer. Is it switched on?";

/** A Morphorider on a serial port that this browser opens. */
export const morphorider: Source = {
  kind: "morphorider",
  label: "Connect a Morphorider",
  hint: "Over USB or a paired Bluetooth port; no bridge is needed.",
  device: {
    kind: "morphorider",
    name: "Morphorider",
    wheel: { circumference: CIRCUMFERENCE, ticks_per_turn: TICKS_PER_TURN, offset: [0, 0, 0] },
    mounting: [1, 0, 0, 0],
    reference: REFERENCE,
    calibration: null,
    array: null,
  },
  missing: (window) => ("serial" in window.navigator ? "" : "This browser cannot open serial ports; Chrome can."),
  start: startMorphorider,
};

async function startMorphorider(window: Window, handlers: SourceHandlers): Promise<StopSource> {
  const port = await (window.navigator as WithSerial).serial?.requestPort().catch(() => undefined);
  if (!port) {
    handlers.failed("No port was chosen.");
    return () => undefined;
  }
  const line = new SerialLine(port);
  void ride(line, handlers);
  return () => line.close();
}

/** Ask for frames, never two at once, until the line is closed. */
async function ride(line: SerialLine, handlers: SourceHandlers): Promise<void> {
  const odometer = new Odometer(TICKS_PER_TURN, CIRCUMFERENCE);
  let faults = 0;
  try {
    await line.open();
    while (!line.closed && faults < MOST_FAULTS) {
      const due = performance.now() + PERIOD;
      const frame = await ask(line);
      const time = performance.now() / 1000;
      const ticks = frame && odometer.follow(frame.ticks, time);
      faults = frame ? 0 : faults + 1;
      if (frame && ticks) handlers.reading({ time, ticks, acceleration: frame.acceleration, magnetic: frame.magnetic });
      await pause(due - performance.now());
    }
    if (!line.closed) handlers.failed(LOST);
  } catch (error) {
    if (!line.closed) handlers.failed(`The port failed: ${error instanceof Error ? error.message : String(error)}`);
  }
  line.close();
}

/** One request and its answer; undefined after a late, short or senseless one, with the line quiet again. */
async function ask(line: SerialLine): Promise<Frame | undefined> {
  if (line.waiting > 0) await line.drain();
  await line.write(REQUEST);
  const frame = decodeFrame(await line.take(FRAME_LENGTH, PATIENCE));
  if (!frame) await line.drain();
  return frame;
}

/** Bytes of a port, taken by number or by patience, whichever ends first. */
export class SerialLine {
  closed = false;
  #bytes: number[] = [];
  #arrived = (): void => undefined;
  #writer: WritableStreamDefaultWriter<Uint8Array> | undefined;
  #reader: ReadableStreamDefaultReader<Uint8Array> | undefined;

  constructor(private readonly port: SerialPort) {}

  /** Bytes that came and were not taken. */
  get waiting(): number {
    return this.#bytes.length;
  }

  async open(): Promise<void> {
    await this.port.open({ baudRate: BAUD_RATE });
    this.#writer = this.port.writable?.getWriter();
    this.#reader = this.port.readable?.getReader();
    void this.#pump();
  }

  async write(byte: number): Promise<void> {
    await this.#writer?.write(Uint8Array.of(byte));
  }

  /** The next bytes, fewer when they do not come in time (ms). */
  async take(count: number, patience: number): Promise<Uint8Array> {
    const until = performance.now() + patience;
    while (this.#bytes.length < count && performance.now() < until && !this.closed) {
      await this.#nextBytes(until - performance.now());
    }
    return Uint8Array.from(this.#bytes.splice(0, count));
  }

  /** Drop what comes until the device is quiet. */
  async drain(): Promise<void> {
    do this.#bytes = [];
    while ((await this.take(1, QUIET)).length > 0);
  }

  close(): void {
    if (this.closed) return;
    this.closed = true;
    void this.#reader
      ?.cancel()
      .then(() => this.#writer?.close())
      .then(() => {
        this.#reader?.releaseLock();
        this.#writer?.releaseLock();
        return this.port.close();
      })
      .catch(() => undefined);
  }

  async #pump(): Promise<void> {
    while (this.#reader && !this.closed) {
      const { value, done } = await this.#reader.read().catch(() => ({ value: undefined, done: true }));
      if (done) return;
      this.#bytes.push(...(value ?? []));
      this.#arrived();
    }
  }

  #nextBytes(milliseconds: number): Promise<void> {
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, milliseconds);
      this.#arrived = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  }
}

function pause(milliseconds: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, Math.max(milliseconds, 0)));
}
