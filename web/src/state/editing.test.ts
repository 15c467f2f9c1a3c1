import { expect, it } from "vitest";
import type { Curve, CurveMarks, CurveUpdate } from "../wire.gen";
import { type CurvePlace, type Drag, EditStore, type Eye, lengthUpTo, placeOn } from "./editing.svelte";
import { History } from "./history.svelte";
import { Network } from "./network";
import type { SessionStore } from "./session.svelte";

/** A session with one straight curve of 100 samples, drawn at every tenth, and nodes 0, 1 and 2 on it; and one with node 3. */
function setup() {
  const network = new Network();
  const positions = Array.from({ length: 10 }, (_, i) => [i, 0, 0]).flat();
  const samples = Array.from({ length: 10 }, (_, i) => 10 * i);
  const curve = { index: 0, boundary: false, closed: false, ended: true, positions, samples };
  network.apply({ type: "live.network", curves: [curve, { ...curve, index: 1 }], nodes: [] });
  const marks = [0, 50, 90].map((sample, node) => ({ sample, node }));
  const details = [
    { index: 0, samples: 100, marks },
    { index: 1, samples: 100, marks: [{ sample: 20, node: 3 }] },
  ] as Curve[];
  const tried: (readonly CurveMarks[])[] = [];
  const store = {
    network,
    details,
    scanned: true,
    id: "s",
    history: new History(),
    api: { curves: () => Promise.resolve(details.map((d) => ({ ...d }))) },
    detailsOf: (index: number) => details.find((d) => d.index === index),
    needSamples: () => undefined,
    tryOut: (trial: readonly CurveMarks[] = []) => void tried.push(trial),
    command: (work: () => Promise<unknown>) => work(),
    write: (changes: readonly { index: number; change: Partial<CurveUpdate> }[]) => {
      for (const { index, change } of changes) Object.assign(details.find((d) => d.index === index) ?? {}, change);
      return Promise.resolve();
    },
  };
  const edit = new EditStore(store as unknown as SessionStore);
  edit.toggle();
  const marked = (index: number): string => details[index]?.marks.map((m) => `${m.node}@${m.sample}`).join(" ") ?? "";
  return { edit, store, tried, marked };
}

/** The pointer's x is the point of curve 0 times ten; y is the distance from it; node 2 is where x is 90, node 3 at y 100. */
const eye: Eye = {
  curveAt: ({ x, y }, network, reach, curves) =>
    y <= reach && (curves ?? [0]).includes(0) ? placeOn(network, 0, Math.min(Math.round(x / 10), 9)) : undefined,
  nodeAt: ({ x, y }, _network, except) => {
    const found = y === 100 ? 3 : y === 0 ? [0, 50, 90].indexOf(x) : -1;
    return found < 0 || found === except ? undefined : found;
  },
};

it("marks a node where a curve is clicked, away from nodes only", async () => {
  const { edit, marked, store } = setup();
  edit.move({ x: 50, y: 0 }, eye);
  expect(edit.cursor).toBeUndefined();
  edit.move({ x: 30, y: 3 }, eye);
  expect(edit.cursor).toMatchObject({ curve: 0, sample: 30, position: [3, 0, 0] });
  await edit.markAtCursor();
  expect(marked(0)).toBe("0@0 4@30 1@50 2@90");
  await store.history.undo();
  expect(marked(0)).toBe("0@0 1@50 2@90");
});

it("draws a node along its curve between its neighbours, trying every place", async () => {
  const { edit, tried, marked } = setup();
  expect(edit.press({ x: 50, y: 0 }, eye)).toBe(true);
  edit.move({ x: 51, y: 0 }, eye);
  expect(edit.drag).toBeUndefined();
  edit.move({ x: 70, y: 5 }, eye);
  edit.move({ x: 95, y: 5 }, eye);
  expect(tried.map((trial) => trial[0]?.marks[1]?.sample)).toEqual([70, 89]);
  expect(marked(0)).toBe("0@0 1@50 2@90");
  await edit.release();
  expect(marked(0)).toBe("0@0 1@89 2@90");
});

it("puts a node back that is dropped away from its curve", async () => {
  const { edit, tried, marked } = setup();
  edit.press({ x: 50, y: 0 }, eye);
  edit.move({ x: 70, y: 5 }, eye);
  edit.move({ x: 70, y: 90 }, eye);
  await edit.release();
  expect(tried.at(-1)).toEqual([]);
  expect(marked(0)).toBe("0@0 1@50 2@90");
});

it("joins a node with the one that it is dropped on, and splits one mark off again", async () => {
  const { edit, marked, store } = setup();
  edit.press({ x: 50, y: 0 }, eye);
  edit.move({ x: 60, y: 5 }, eye);
  edit.move({ x: 60, y: 100 }, eye);
  expect((edit.drag as Drag | undefined)?.onto).toBe(3);
  await edit.release();
  expect([marked(0), marked(1), edit.node]).toEqual(["0@0 3@50 2@90", "3@20", 3]);
  await edit.split(3, { curve: 1, sample: 20 });
  expect([marked(0), marked(1)]).toEqual(["0@0 3@50 2@90", "4@20"]);
  await store.history.undo();
  await store.history.undo();
  expect([marked(0), marked(1)]).toEqual(["0@0 1@50 2@90", "3@20"]);
});

it("does the same by key", async () => {
  const { edit, marked } = setup();
  await edit.step(1, 0);
  await edit.step(2, 0);
  expect((edit.cursor as CurvePlace | undefined)?.sample).toBe(20);
  await edit.markAtCursor();
  edit.choose(4);
  await edit.step(10, 0);
  await edit.step(100, 0);
  expect(marked(0)).toBe("0@0 4@49 1@50 2@90");
  await edit.deleteNode(4);
  expect(marked(0)).toBe("0@0 1@50 2@90");
});

it("does what mends a problem and takes it back", async () => {
  const { edit, marked, store } = setup();
  const nothing = { boundary: null, closed: null, removed: null, marks: null, lengths: null };
  const marks = [{ sample: 7, node: 3 }];
  const changes = [
    { curve: 1, change: { ...nothing, marks } },
    { curve: 0, change: { ...nothing, boundary: true } },
  ];
  const fix = { label: "Join", changes };
  Object.assign(store.details[0] ?? {}, { boundary: false });
  await edit.mend({ message: "", severity: "error", curves: [1], samples: null, fix });
  expect([marked(1), store.details[0]?.boundary, store.history.last?.label]).toEqual(["3@7", true, "Join"]);
  await store.history.undo();
  expect([marked(1), store.details[0]?.boundary]).toEqual(["3@20", false]);
});

it("measures along the curve as drawn", () => {
  const { store } = setup();
  const place = placeOn(store.network, 0, 7) as CurvePlace;
  expect(lengthUpTo(store.network, place)).toBeCloseTo(7, 9);
  expect(placeOn(store.network, 5, 0)).toBeUndefined();
  expect(placeOn(store.network, 0, 99)).toBeUndefined();
});
