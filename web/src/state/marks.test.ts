import { expect, it } from "vitest";
import type { Curve } from "../wire.gen";
import {
  lengthsWith,
  marksChanged,
  marksWith,
  newNode,
  placesOf,
  roomFor,
  sameMarks,
  segmentsOf,
  unmarked,
} from "./marks";

const marks = [
  { sample: 0, node: 1 },
  { sample: 90, node: 2 },
];

it("adds places in the order of the samples, none twice", () => {
  const places = [
    { curve: 4, sample: 40 },
    { curve: 4, sample: 90 },
  ];
  const added = marksWith(marks, places, 2);
  expect(added).toEqual([marks[0], { sample: 40, node: 2 }, marks[1]]);
  expect(marksWith(added, places, 2)).toEqual(added);
});

it("tells whether marks are the same", () => {
  expect(sameMarks(marks, marks.map((mark) => ({ ...mark })))).toBe(true);
  expect(sameMarks(marks, marks.slice(1))).toBe(false);
  expect(sameMarks(marks, [{ sample: 0, node: 1 }, { sample: 90, node: 3 }])).toBe(false);
});

it("leaves of proposals what is not marked yet", () => {
  const curves = [{ index: 0, marks }, { index: 1, marks: [] as typeof marks }] as Curve[];
  const places = [
    { curve: 0, sample: 90 },
    { curve: 1, sample: 7 },
  ];
  const half = { node: 2, confidence: 0.9, places };
  const whole = { node: 2, confidence: 1, places: places.slice(0, 1) };
  const fresh = { node: null, confidence: 0.5, places };
  expect(unmarked([half, whole, fresh], curves)).toEqual([{ ...half, places: places.slice(1) }, fresh]);
  expect(newNode(curves)).toBe(3);
  expect(newNode([])).toBe(0);
});

it("moves, renames and takes away one mark and leaves the others", () => {
  const first = marks[0] as (typeof marks)[0];
  expect(marksChanged(marks, first, { sample: 95 })).toEqual([marks[1], { sample: 95, node: 1 }]);
  expect(marksChanged(marks, first, { node: 7 })).toEqual([{ sample: 0, node: 7 }, marks[1]]);
  expect(marksChanged(marks, first, undefined)).toEqual([marks[1]]);
  expect(marksChanged(marks, { sample: 1, node: 1 }, undefined)).toEqual(marks);
});

it("lets a mark move between its neighbours only", () => {
  const three = [...marks, { sample: 120, node: 3 }];
  expect(roomFor(three, 90, 200)).toEqual([1, 119]);
  expect(roomFor(three, 0, 200)).toEqual([0, 89]);
  expect(roomFor(three, 120, 200)).toEqual([91, 199]);
});

it("finds every mark of a node, also two on one curve", () => {
  const curves = [
    { index: 0, marks: [...marks, { sample: 120, node: 1 }] },
    { index: 3, marks },
  ] as Curve[];
  expect(placesOf(curves, 1)).toEqual([
    { curve: 0, sample: 0 },
    { curve: 0, sample: 120 },
    { curve: 3, sample: 0 },
  ]);
});

it("cuts curves at their marks, closed ones all the way round, and knows what was measured", () => {
  const three = [...marks, { sample: 120, node: 3 }];
  const names = (curve: Parameters<typeof segmentsOf>[0]): string[] =>
    segmentsOf(curve).map((segment) => `${segment.name} ${segment.measured ?? ""}`.trim());
  const lengths = [{ first: 120, last: 0, length: 0.4 }];
  expect(names({ marks: three, closed: false, lengths, samples: 200 })).toEqual(["1–2", "2–3"]);
  expect(names({ marks: three, closed: true, lengths, samples: 200 })).toEqual(["1–2", "2–3", "3–1 0.4"]);
  expect(names({ marks: [...three, { sample: 150, node: 1 }], closed: true, lengths, samples: 200 })).toEqual(["1–2", "2–3", "3–1"]);
  expect(names({ marks: [], closed: true, lengths: [{ first: 0, last: 199, length: 2 }], samples: 200 })).toEqual([
    "whole curve 2",
  ]);
  expect(names({ marks: [], closed: false, lengths, samples: 1 })).toEqual([]);
});

it("cuts an open curve with one mark into what lies before it and after it", () => {
  const lengths = [{ first: 50, last: 199, length: 0.3 }];
  const names = (sample: number): string[] =>
    segmentsOf({ marks: [{ sample, node: 7 }], closed: false, lengths, samples: 200 }).map(
      ({ name, first, last, measured }) => `${name} ${first} ${last} ${measured ?? ""}`.trim(),
    );
  expect(names(50)).toEqual(["start–7 0 50", "7–end 50 199 0.3"]);
  expect(names(0)).toEqual(["7–end 0 199"]);
  expect(names(199)).toEqual(["start–7 0 199"]);
});

it("sets and takes away one measured length", () => {
  const [segment] = segmentsOf({ marks, closed: false, lengths: [], samples: 200 });
  if (!segment) throw new Error("there is a segment");
  const other = { first: 5, last: 9, length: 1 };
  const set = lengthsWith([other], segment, 0.3);
  expect(set).toEqual([other, { first: 0, last: 90, length: 0.3 }]);
  expect(lengthsWith(set, segment, 0.5)).toEqual([other, { first: 0, last: 90, length: 0.5 }]);
  expect(lengthsWith(set, segment, undefined)).toEqual([other]);
});
