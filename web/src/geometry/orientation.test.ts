import { expect, it } from "vitest";
import { continued, fromDeviceAngles, isRotation, product, type Quaternion, rotate } from "./orientation";

const near = (a: readonly number[], b: readonly number[]): void =>
  a.forEach((value, i) => expect(value).toBeCloseTo(b[i] ?? NaN, 12));

it("a flat phone whose top points West has its y axis to the West", () => {
  const q = fromDeviceAngles(90, 0, 0);
  near(q, [Math.SQRT1_2, 0, 0, Math.SQRT1_2]);
  near(rotate(q, [0, 1, 0]), [-1, 0, 0]);
});

it("a phone held upright and facing South has its screen to the South and its top up", () => {
  const q = fromDeviceAngles(0, 90, 0);
  near(rotate(q, [0, 0, 1]), [0, -1, 0]);
  near(rotate(q, [0, 1, 0]), [0, 0, 1]);
});

it("rolling to the right lowers the right side", () => {
  near(rotate(fromDeviceAngles(0, 0, 90), [1, 0, 0]), [0, 0, -1]);
});

it.each([
  ["on its back", 0, 0, [0, 0, 1], [0, 1, 0]],
  ["on its screen", 180, 0, [0, 0, -1], [0, -1, 0]],
  ["standing", 90, 0, [0, 1, 0], [0, 0, -1]],
  ["on its head", -90, 0, [0, -1, 0], [0, 0, 1]],
  ["on its right side", 0, 90, [-1, 0, 0], [0, 1, 0]],
  ["on its left side", 0, -90, [1, 0, 0], [0, 1, 0]],
] as const)("a phone %s, facing each of four ways", (_name, beta, gamma, up, north) => {
  for (const [alpha, to] of [[0, [0, 1, 0]], [90, [-1, 0, 0]], [180, [0, -1, 0]], [270, [1, 0, 0]]] as const) {
    const q = fromDeviceAngles(alpha, beta, gamma);
    near(rotate(q, up), [0, 0, 1]);
    near(rotate(q, north), to);
  }
});

it("products turn one after the other", () => {
  const [a, b] = [fromDeviceAngles(10, 20, 30), fromDeviceAngles(-40, 5, 70)];
  const v = [0.3, -0.2, 0.9] as const;
  near(rotate(product(a, b), v), rotate(a, rotate(b, v)));
});

it("a series has no jumps of sign, and what is no rotation is told", () => {
  const q = fromDeviceAngles(33, 44, 55);
  const flipped = q.map((value) => -value) as Quaternion;
  near(continued(flipped, q), q);
  near(continued(flipped, undefined), flipped);
  expect([isRotation(q), isRotation([0, 0, 0, 0]), isRotation([NaN, 0, 0, 1])]).toEqual([true, false, false]);
});
