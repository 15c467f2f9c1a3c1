import { describe, expect, it } from "vitest";
import { Odometer } from "./odometer";

describe("Odometer", () => {
  it("passes on what a hand can do", () => {
    const odometer = new Odometer(500, 0.1);
    expect(odometer.follow([7, 490], 0)).toEqual([7, 490]);
    expect(odometer.follow([8, 5], 0.016)).toEqual([8, 5]);
    expect(odometer.follow([7, 480], 0.03)).toEqual([7, 480]);
  });

  it("does not believe a single wild counter", () => {
    const odometer = new Odometer(500, 0.1);
    odometer.follow([7, 0], 0);
    expect(odometer.follow([90, 0], 0.016)).toBeUndefined();
    expect(odometer.follow([7, 10], 0.032)).toEqual([7, 10]);
  });

  it("goes on over a restart of the counter, from where it was", () => {
    const odometer = new Odometer(500, 0.1);
    odometer.follow([200, 250], 0);
    const seen = Array.from({ length: 7 }, (_, i) => odometer.follow([0, 10 * i], 0.016 * (i + 1)));
    expect(seen.slice(0, 4)).toEqual([undefined, undefined, undefined, undefined]);
    expect(seen.slice(4)).toEqual([
      [200, 250],
      [200, 260],
      [200, 270],
    ]);
  });

  it("counts backwards through zero", () => {
    const odometer = new Odometer(500, 0.1);
    odometer.follow([0, 3], 0);
    odometer.follow([90, 0], 0.01);
    expect(odometer.follow([0, -4], 0.02)).toEqual([-1, 496]);
  });
});
