import { describe, expect, it } from "vitest";
import { type Command, History } from "./history.svelte";

/** Appends a letter to a word. */
function append(word: string[], letter: string): Command {
  return {
    label: letter,
    run: () => Promise.resolve(void word.push(letter)),
    revert: () => Promise.resolve(void word.pop()),
  };
}

describe("History", () => {
  it("takes back and does again, in order", async () => {
    const [word, history]: [string[], History] = [[], new History()];
    for (const letter of "abc") await history.do(append(word, letter));
    await history.undo();
    await history.undo();
    expect([word.join(""), history.last?.label]).toEqual(["a", "a"]);
    await history.redo();
    expect(word.join("")).toBe("ab");
  });

  it("forgets what was taken back once something else is done", async () => {
    const [word, history]: [string[], History] = [[], new History()];
    await history.do(append(word, "a"));
    await history.undo();
    await history.do(append(word, "b"));
    await history.redo();
    expect(word.join("")).toBe("b");
  });

  it("keeps nothing of a change that failed", async () => {
    const history = new History();
    const failing = { label: "x", run: () => Promise.reject(new Error("no")), revert: () => Promise.resolve() };
    await expect(history.do(failing)).rejects.toThrow("no");
    expect(history.last).toBeUndefined();
    await history.undo();
  });

  it("does one thing after another, however soon they are asked for", async () => {
    const [word, history]: [string[], History] = [[], new History()];
    const slowly = (letter: string): Command => ({
      label: letter,
      run: () => new Promise((resolve) => setTimeout(() => resolve(void word.push(letter)), 5)),
      revert: () => new Promise((resolve) => setTimeout(() => resolve(void word.pop()), 5)),
    });
    const plan = (): Promise<Command> => Promise.resolve(slowly(String(word.length)));
    await Promise.all([history.do(slowly("a")), history.plan(plan), history.undo(), history.undo(), history.redo()]);
    expect([word, history.last?.label, history.undone.length]).toEqual([["a"], "a", 1]);
    await history.plan(() => Promise.resolve(undefined));
    expect(history.last?.label).toBe("a");
  });
});
