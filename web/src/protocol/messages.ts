import type {
  LiveCurveEnd,
  LiveCurveStart,
  LiveDevice,
  LiveNetwork,
  LiveNode,
  LivePoints,
  LiveReading,
  LiveReconstruction,
  LiveWatchers,
  Snapshot,
} from "../wire.gen";

/** What a browser receives while it watches a session. */
export type ToBrowser =
  | Snapshot
  | LiveCurveStart
  | LivePoints
  | LiveNode
  | LiveCurveEnd
  | LiveNetwork
  | LiveReading
  | LiveDevice
  | LiveWatchers
  | LiveReconstruction;

const known: ReadonlySet<string> = new Set<ToBrowser["type"]>([
  "live.snapshot",
  "live.curve.start",
  "live.points",
  "live.node",
  "live.curve.end",
  "live.network",
  "live.reading",
  "live.device",
  "live.watchers",
  "live.reconstruction",
]);

/** The message in a text frame; undefined when its type is not known, as a newer server may send. */
export function parseLive(text: string): ToBrowser | undefined {
  const value: unknown = JSON.parse(text);
  const type = typeof value === "object" && value !== null && "type" in value ? value.type : undefined;
  return typeof type === "string" && known.has(type) ? (value as ToBrowser) : undefined;
}
