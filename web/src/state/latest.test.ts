import { expect, it } from "vitest";
import { Latest } from "./latest";

it("does the first wish at once and of the rest only the last", async () => {
  const [done, ends]: [number[], (() => void)[]] = [[], []];
  const latest = new Latest<number>((wish) => {
    done.push(wish);
    return new Promise((resolve) => ends.push(resolve));
  });
  const finished = latest.want(1);
  void latest.want(2);
  void latest.want(3);
  expect(done).toEqual([1]);
  ends[0]?.();
  await new Promise((resolve) => setTimeout(resolve));
  expect(done).toEqual([1, 3]);
  ends[1]?.();
  await finished;
  void latest.want(4);
  expect(done).toEqual([1, 3, 4]);
});
