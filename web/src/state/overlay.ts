import type { Placement } from "../geometry/labels";
import type { Vector } from "../geometry/vectors";

export interface Place {
  readonly x: number;
  readonly y: number;
}

/** A measured distance between two places. */
export interface Ruler {
  readonly from: Place;
  readonly to: Place;
  readonly text: string;
}

/** What lies over the 3D view, in CSS px. */
export interface OverlayContent {
  readonly labels: readonly Placement[];
  /** Ends of the curves that are being scanned. */
  readonly tips: readonly Place[];
  /** Points that a person picked, or that a plot points at. */
  readonly marks: readonly Place[];
  readonly ruler: Ruler | undefined;
  readonly metresPerPixel: number;
  /** World axes x, y, z as the eye sees them: right, up and towards it, for each. */
  readonly axes: readonly [Vector, Vector, Vector];
}

export const EMPTY_OVERLAY: OverlayContent = {
  labels: [],
  tips: [],
  marks: [],
  ruler: undefined,
  metresPerPixel: 0,
  axes: [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ],
};
