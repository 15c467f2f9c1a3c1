import type { Quaternion } from "../geometry/orientation";
import type { Device } from "../wire.gen";
import type { Triple } from "./framing";

/** What is measured at one moment; time in s of the page's own clock. */
export type Reading =
  | { readonly time: number; readonly quaternion: Quaternion }
  | {
      readonly time: number;
      readonly ticks: [number, number];
      readonly acceleration: Triple;
      readonly magnetic: Triple;
    };

export interface SourceHandlers {
  reading(reading: Reading): void;
  /** Why there are no readings, in words. */
  failed(words: string): void;
}

/** Ends the readings. */
export type StopSource = () => void;

/** Something that this page can read by itself. */
export interface Source {
  readonly kind: string;
  readonly label: string;
  readonly hint: string;
  readonly device: Omit<Device, "id">;
  /** What the browser lacks before it can be asked; empty when nothing. */
  missing(window: Window): string;
  /** Begin to read; must be called from a tap, because browsers ask the person. */
  start(window: Window, handlers: SourceHandlers): Promise<StopSource>;
}

/** Directions that a device at rest sees, unless it is told better: those of the wire protocol. */
export const REFERENCE: Device["reference"] = { acceleration: [0, 0, 1], magnetic: [0.5, 0, -0.8660254037844386] };
