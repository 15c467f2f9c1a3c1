import { formatCount, formatLength, formatSeconds } from "../geometry/units";
import type { Report } from "./result";

export interface Figure {
  readonly label: string;
  readonly value: string;
}

/** The few figures of a report that a person wants at a glance; what is missing is left out. */
export function figuresOf(report: Report): Figure[] {
  const candidates: (Figure | undefined)[] = [
    figure("Uncertainty, mean", at(report, "network", "uncertainty", "mean_m"), formatLength),
    figure("Gaps closed, rms", at(report, "network", "closure", "rms_m"), formatLength),
    figure("Noise of the frames", at(report, "network", "frame_noise_deg"), degrees),
    figure("Step", at(report, "network", "parameters", "step_m"), formatLength),
    figure("Triangles", at(report, "surface", "faces"), formatCount),
    figure("Smallest angle", at(report, "surface", "min_angle_deg"), degrees),
    figure("Time", report.seconds, formatSeconds),
  ];
  return candidates.filter((candidate) => candidate !== undefined);
}

function at(report: Report, ...path: string[]): unknown {
  return path.reduce<unknown>(
    (value, key) => (value && typeof value === "object" ? (value as Record<string, unknown>)[key] : undefined),
    report,
  );
}

function degrees(value: number): string {
  return `${value.toFixed(1)}°`;
}

function figure(label: string, value: unknown, format: (value: number) => string): Figure | undefined {
  return typeof value === "number" && Number.isFinite(value) ? { label, value: format(value) } : undefined;
}
