import { formatCount, formatLength, formatSeconds } from "../geometry/units";
import type { Report } from "./result";

export interface Figure {
  readonly label: string;
  readonly value: string;
}

/** The few figures of a report that a person wants at a glance; what is missing is left out. */
export function figuresOf(report: Report): Figure[] {
  const surface = report.surface ?? {};
  const candidates: (Figure | undefined)[] = [
    figure("Triangles", surface["faces"], formatCount),
    figure("Smallest angle", surface["min_angle"], (degrees) => `${degrees.toFixed(1)}°`),
    figure("Patches", surface["patches"], formatCount),
    figure("Step", report.network?.["step"], formatLength),
    figure("Time", report.seconds, formatSeconds),
  ];
  return candidates.filter((candidate) => candidate !== undefined);
}

function figure(label: string, value: unknown, format: (value: number) => string): Figure | undefined {
  return typeof value === "number" && Number.isFinite(value) ? { label, value: format(value) } : undefined;
}
