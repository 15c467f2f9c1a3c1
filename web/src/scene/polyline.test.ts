import type { InterleavedBufferAttribute } from "three";
import type { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { expect, it } from "vitest";
import { Polyline } from "./polyline";

it("keeps no list of what waits to be drawn while nothing is: a hidden page would grow with every point", () => {
  const line = new Polyline();
  const points = Float32Array.from({ length: 150 }, (_, i) => i);
  line.set(points.subarray(0, 30));
  for (let count = 11; count <= 50; count += 1) line.set(points.subarray(0, 3 * count), count - 1);
  const { geometry } = line.object.children[0] as LineSegments2;
  const { data } = geometry.getAttribute("instanceStart") as InterleavedBufferAttribute;
  expect(data.updateRanges).toEqual([{ start: 0, count: 6 * 49 }]);
  expect([...data.array.subarray(6 * 48, 6 * 49)]).toEqual([144, 145, 146, 147, 148, 149]);
});
