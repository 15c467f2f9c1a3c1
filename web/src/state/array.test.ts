import { expect, test } from "vitest";
import type { LiveReading } from "../wire.gen";
import { ArrayStore } from "./array.svelte";

function reading(number: number, recording = "ribbon"): LiveReading {
  const curve = { index: 0, boundary: false, closed: false, ended: true, positions: [number, 0, 0, number, 1, 0], samples: [] };
  return { type: "live.reading", recording, number, time: number / 30, curves: [curve], nodes: [] };
}

function opened(live = ["ribbon"]): { array: ArrayStore; changes: boolean[] } {
  const changes: boolean[] = [];
  const array = new ArrayStore({
    fetch: (number) => Promise.resolve(reading(number)),
    isLive: (recording) => live.includes(recording),
    changed: (outdates) => void changes.push(outdates),
    failed: (error) => expect.fail(String(error)),
  });
  return { array, changes };
}

test("the newest reading is shown; what is known when the page opens outdates nothing", () => {
  const { array, changes } = opened();
  for (const number of [4, 4, 5]) array.hear(reading(number));
  expect(changes).toEqual([false, false, true]);
  expect([array.shown?.number, array.count]).toEqual([5, 6]);
  expect(array.network.curves.get(0)?.points.coordinates[0]).toBe(5);
});

test("a reading that somebody chose stays until the newest is wanted again", async () => {
  const { array } = opened();
  array.hear(reading(5));
  array.choose(2);
  await Promise.resolve();
  await Promise.resolve();
  array.hear(reading(6));
  expect([array.shown?.number, array.count]).toEqual([2, 7]);
  array.choose(undefined);
  array.hear(reading(7));
  expect(array.shown?.number).toBe(7);
  array.hold();
  array.hear(reading(8));
  expect(array.shown?.number).toBe(7);
});

test("another array is shown only once the one before is gone", () => {
  const live = ["ribbon"];
  const { array } = opened(live);
  array.hear(reading(0));
  array.hear(reading(1, "comb"));
  expect(array.shown?.recording).toBe("ribbon");
  live.pop();
  array.hear(reading(2, "comb"));
  expect(array.shown?.recording).toBe("comb");
});
