/** Morphorider frames: eleven big-endian signed 16-bit integers, as the bridge reads them by default: whole wheel turns,
 * ticks within a turn, acceleration and magnetic field (1 is full scale), and three that are reserved. */

export const FRAME_LENGTH = 22;
/** The byte that asks for a frame. */
export const REQUEST = "Q".charCodeAt(0);
export const TICKS_PER_TURN = 500;
const FULL_SCALE = 32768;

export type Triple = [number, number, number];

export interface Frame {
  readonly ticks: readonly [number, number];
  readonly acceleration: Triple;
  readonly magnetic: Triple;
}

/** The frame in exactly 22 bytes; undefined when there are more or fewer, or when no device can mean them. */
export function decodeFrame(bytes: Uint8Array): Frame | undefined {
  if (bytes.length !== FRAME_LENGTH) return undefined;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const vector = (offset: number): Triple => [0, 2, 4].map((i) => view.getInt16(offset + i) / FULL_SCALE) as Triple;
  const frame: Frame = {
    ticks: [view.getInt16(0), view.getInt16(2)],
    acceleration: vector(4),
    magnetic: vector(10),
  };
  const directions = frame.acceleration.some(Boolean) && frame.magnetic.some(Boolean);
  return directions && Math.abs(frame.ticks[1]) < TICKS_PER_TURN ? frame : undefined;
}
