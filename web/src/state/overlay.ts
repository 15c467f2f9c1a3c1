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

/** What a person who edits nodes has in hand. */
export interface Editing {
  /** Where the next mark would be, or where the node that is drawn along goes. */
  readonly cursor: Place | undefined;
  /** The node that is chosen or drawn along. */
  readonly node: number | undefined;
  /** The node that it would become one with. */
  readonly onto: number | undefined;
}

/** A place that keeps the network from being one. */
export interface Flag {
  readonly line: readonly Place[];
  readonly warning: boolean;
}

/** What lies over the 3D view, in CSS px. */
export interface OverlayContent {
  readonly labels: readonly Placement[];
  /** Ends of the curves that are being scanned. */
  readonly tips: readonly Place[];
  /** Points that a person picked, or that a plot points at. */
  readonly marks: readonly Place[];
  readonly ruler: Ruler | undefined;
  readonly flags: readonly Flag[];
  /** Undefined while nodes are not edited. */
  readonly editing: Editing | undefined;
  readonly metresPerPixel: number;
  /** World axes x, y, z as the eye sees them: right, up and towards it, for each. */
  readonly axes: readonly [Vector, Vector, Vector];
}

export const EMPTY_OVERLAY: OverlayContent = {
  labels: [],
  tips: [],
  marks: [],
  ruler: undefined,
  flags: [],
  editing: undefined,
  metresPerPixel: 0,
  axes: [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ],
};
