import { expect, it } from "vitest";
import { next } from "./editKeys";
import { dispatchKey, keyName, padNumber } from "./shortcuts";

function pressed(key: string, more: Partial<KeyboardEvent> = {}): KeyboardEvent {
  return { key, code: "", target: null, preventDefault: () => undefined, ...more } as KeyboardEvent;
}

// Outside a browser there are no elements: what belongs to a control is tested in one.
globalThis.HTMLElement ??= Object as unknown as typeof HTMLElement;

it("runs the shortcut of the key, and none with a modifier", () => {
  const done: string[] = [];
  const keys = ["a", "arrowleft"].map((key) => ({ keys: key, does: key, run: () => void done.push(key) }));
  expect(dispatchKey(pressed("A"), keys)).toBe(true);
  expect(dispatchKey(pressed("ArrowLeft"), keys)).toBe(true);
  expect(dispatchKey(pressed("a", { ctrlKey: true }), keys)).toBe(false);
  expect(dispatchKey(pressed("z"), keys)).toBe(false);
  expect(done).toEqual(["a", "arrowleft"]);
});

it("knows the digits of the number pad from the others", () => {
  expect(padNumber(pressed("3", { code: "Numpad3" }))).toBe(3);
  expect(padNumber(pressed("End", { code: "Numpad1" }))).toBe(1);
  expect(padNumber(pressed("3", { code: "Digit3" }))).toBeUndefined();
});

it("names keys as they are printed", () => {
  const run = (): void => undefined;
  expect(keyName({ keys: "a", does: "", run })).toBe("A");
  expect(keyName({ keys: "arrowleft", label: "←", does: "", run })).toBe("←");
});

it("goes round a list in both directions", () => {
  expect([next([2, 5, 7], undefined, 1), next([2, 5, 7], undefined, -1)]).toEqual([2, 7]);
  expect([next([2, 5, 7], 7, 1), next([2, 5, 7], 2, -1), next([2, 5, 7], 5, 1)]).toEqual([2, 7, 7]);
  expect(next([], 3, 1)).toBeUndefined();
});
