import { describe, expect, it } from "vitest";
import type { Recorded, RecordingState, Spool } from "../protocol/spool";
import type { Quaternion } from "../geometry/orientation";
import type { Device } from "../wire.gen";
import { freshRecording, Recorder } from "./recorder";

const device = { id: "r", kind: "phone" } as Device;

function memory() {
  const messages: Recorded[] = [];
  let kept: RecordingState | undefined;
  const spool: Spool = {
    state: () => Promise.resolve(kept),
    append: async (message, next) => {
      await new Promise((resolve) => setTimeout(resolve));
      messages.push(message);
      kept = next;
    },
    from: () => Promise.resolve([]),
    forgetBefore: () => Promise.resolve(),
    clear: () => Promise.resolve(),
  };
  return { spool, messages, kept: () => kept };
}

const reading = (time: number) => ({ time, quaternion: [1, 0, 0, 0] as Quaternion });

describe("Recorder", () => {
  it("numbers messages without gaps, counts samples, and marks the sample that was last", async () => {
    const { spool, messages } = memory();
    const recorder = await Recorder.resume(spool, freshRecording("r", device), () => undefined);
    await recorder.start(true);
    for (let i = 0; i < 20; i += 1) await recorder.add(reading(i));
    await recorder.mark(3);
    await recorder.add(reading(20));
    await recorder.end(true);
    expect(messages.map((m) => m.seq)).toEqual([0, 1, 2, 3, 4, 5]);
    expect(messages.map((m) => m.type)).toEqual(["curve.start", "samples", "samples", "node", "samples", "curve.end"]);
    expect(messages.flatMap((m) => (m.type === "samples" ? [[m.first_sample, m.time?.length]] : []))).toEqual([
      [0, 15],
      [15, 5],
      [20, 1],
    ]);
    expect(messages[3]).toMatchObject({ sample: 19, node: 3, undo: false });
  });

  it("keeps what a device measures, column by column", async () => {
    const { spool, messages } = memory();
    const recorder = await Recorder.resume(spool, freshRecording("r", device), () => undefined);
    await recorder.start(false);
    await recorder.add({ time: 0, ticks: [1, 2], acceleration: [0, 0, 1], magnetic: [0, 1, 0] });
    await recorder.add({ time: 1, ticks: [1, 3], acceleration: [0, 1, 0], magnetic: [1, 0, 0] });
    await recorder.flush();
    expect(messages[1]).toEqual({
      type: "samples",
      seq: 1,
      curve: 0,
      first_sample: 0,
      time: [0, 1],
      ticks: [[1, 2], [1, 3]],
      acceleration: [[0, 0, 1], [0, 1, 0]],
      magnetic: [[0, 1, 0], [1, 0, 0]],
    });
  });

  it("keeps its order when taps come faster than the database writes", async () => {
    const { spool, messages } = memory();
    const recorder = await Recorder.resume(spool, freshRecording("r", device), () => undefined);
    const started = recorder.start(false);
    for (let i = 0; i < 40; i += 1) void recorder.add(reading(i));
    await Promise.all([started, recorder.mark(0), recorder.end(false)]);
    expect(messages.map((m) => m.seq)).toEqual(messages.map((_, i) => i));
    expect(messages.at(-1)?.type).toBe("curve.end");
  });

  it("goes on after a reload and ends the curve that was open", async () => {
    const before = { recording: "old", device, nextSeq: 7, nextCurve: 2, openCurve: 1, samples: 30 };
    const { spool, messages, kept } = memory();
    const recorder = await Recorder.resume(spool, before, () => undefined);
    expect(messages).toEqual([{ type: "curve.end", seq: 7, curve: 1, closed: false, discard: false }]);
    await recorder.start(false);
    expect(kept()).toEqual({ recording: "old", device, nextSeq: 9, nextCurve: 3, openCurve: 2, samples: 0 });
  });

  it("ignores readings between curves and refuses a mark there", async () => {
    const { spool, messages } = memory();
    const recorder = await Recorder.resume(spool, freshRecording("r", device), () => undefined);
    await recorder.add(reading(0));
    await expect(recorder.mark(0)).rejects.toThrow("has begun");
    expect(messages).toEqual([]);
  });
});
