import { expect, it } from "vitest";
import { lengthScale, ParametersStore, stepScale } from "./parameters.svelte";

it("leaves out of the request what is automatic", () => {
  const parameters = new ParametersStore();
  expect(parameters.request).toEqual({ step: "1.6%", weights: "auto", curve_bias: "auto", soft: false });
  parameters.bend = 0.05;
  parameters.prefilter = 0.004;
  parameters.step = 2.345678;
  expect(parameters.request).toMatchObject({ step: "2.35%", bend: 0.05, prefilter: 0.004 });
  expect(parameters.isDefault).toBe(false);
  parameters.reset();
  expect(parameters.isDefault).toBe(true);
});

it("sliders go from end to end of their range and back", () => {
  expect([stepScale.fromHandle(0), stepScale.fromHandle(1)]).toEqual([0.4, 6]);
  expect([lengthScale.fromHandle(0), lengthScale.fromHandle(1)]).toEqual([0.001, 1]);
  for (const value of [0.0012, 0.03, 0.7]) {
    expect(lengthScale.fromHandle(lengthScale.toHandle(value))).toBeCloseTo(value, 6);
  }
});
