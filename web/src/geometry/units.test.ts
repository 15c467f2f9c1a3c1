import { expect, it } from "vitest";
import { counted, formatAngle, formatCount, formatLength, formatRound, formatSeconds, roundDown, significant } from "./units";

it("lengths come in the unit that suits them", () => {
  expect([0.0004, 0.0123, 0.456, 1.234, 0].map(formatLength)).toEqual(["0.400 mm", "12.3 mm", "45.6 cm", "1.23 m", "0 mm"]);
  expect([0.2, 0.0005, 5].map(formatRound)).toEqual(["20 cm", "0.5 mm", "5 m"]);
});

it("times, angles and counts carry their unit", () => {
  expect([0.0123, 2.4, 180].map(formatSeconds)).toEqual(["12.3 ms", "2.40 s", "3 min"]);
  expect(formatAngle(Math.PI / 3)).toBe("60.0°");
  expect(formatCount(19800)).toBe("19\u202f800");
  expect([0, 1, 2].map((count) => counted(count, "curve"))).toEqual(["0 curves", "1 curve", "2 curves"]);
});

it("numbers have three significant digits and no exponent", () => {
  expect([1234.5, 12.345, -0.012345, 0].map(significant)).toEqual(["1235", "12.3", "-0.0123", "0"]);
});

it("scale bars are 1, 2 or 5 times a power of ten, at most as long as asked", () => {
  for (const limit of [0.0011, 0.3, 1, 1.99, 2, 7, 9.99, 123]) {
    const rounded = roundDown(limit);
    expect(rounded).toBeLessThanOrEqual(limit);
    expect(limit / rounded).toBeLessThan(2.5);
    expect([1, 2, 5]).toContain(Number(rounded.toExponential().split("e")[0]));
  }
});
