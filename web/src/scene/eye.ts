import { nearestOnLines, nearestPlace } from "../geometry/picking";
import { type CurvePlace, type Eye, placeOn } from "../state/editing.svelte";
import type { Network } from "../state/network";
import type { Place } from "../state/overlay";
import type { Viewport } from "./viewport";

/** px around the middle of a node's dot that still mean it. */
const DOT_REACH = 11;

/** What a pointer is at in a 3D view, as the camera stands now. */
export class ViewportEye implements Eye {
  constructor(private readonly viewport: Viewport) {}

  curveAt({ x, y }: Place, network: Network, reach: number, curves?: readonly number[]): CurvePlace | undefined {
    const ended = [...network.curves.values()].filter(({ ended, points }) => ended && points.samples.length > 1);
    const drawn = curves ? ended.filter(({ index }) => curves.includes(index)) : ended;
    const lines = drawn.map(({ points }) => this.#projected(points.coordinates));
    const hit = nearestOnLines(lines, x, y);
    const curve = hit && hit.distance <= reach ? drawn[hit.line] : undefined;
    return hit && curve && placeOn(network, curve.index, hit.point);
  }

  nodeAt({ x, y }: Place, network: Network, except?: number): number | undefined {
    const nodes = [...network.nodes.values()].filter(({ node }) => node !== except);
    const found = nearestPlace(this.#projected(nodes.flatMap(({ position }) => position)), x, y, DOT_REACH);
    return found === undefined ? undefined : nodes[found]?.node;
  }

  #projected(positions: ArrayLike<number>): Float64Array {
    const places = new Float64Array((2 * positions.length) / 3);
    for (let i = 0; i < positions.length / 3; i += 1) {
      const at = (axis: number): number => positions[3 * i + axis] as number;
      const place = this.viewport.project([at(0), at(1), at(2)]);
      places.set(place ? [place.x, place.y] : [NaN, NaN], 2 * i);
    }
    return places;
  }
}
