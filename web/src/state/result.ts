import type { Api } from "../protocol/api";
import type { Reconstruction } from "../wire.gen";
import { mergedNumbers, Network } from "./network";

/** What a reconstruction left, as far as the page needs it. */
export interface Result {
  readonly reconstruction: Reconstruction;
  readonly report: Report;
  readonly network: Network;
  /** The curves' normals on the unit sphere, drawn as if they were points. */
  readonly gaussMap: Network;
  readonly normals: Float32Array;
  readonly positions: Float32Array;
  /** Standard uncertainty of every point, m; undefined when the file has none. */
  readonly uncertain: readonly UncertainLine[] | undefined;
  readonly meshUrl: string | undefined;
}

/** A segment with the standard uncertainty of each of its points, m. */
export interface UncertainLine {
  readonly positions: Float32Array;
  readonly uncertainty: Float32Array;
}

/** The parts of report.json that the page reads; everything may be missing. */
export interface Report {
  readonly seconds?: number;
  readonly network?: Record<string, unknown>;
  readonly surface?: Record<string, unknown>;
}

/** A network JSON file (docs: formats). */
export interface NetworkFile {
  readonly points: readonly (readonly [number, number, number])[];
  readonly normals: readonly (readonly [number, number, number])[];
  readonly nodes: readonly number[];
  readonly uncertainty?: readonly number[];
  readonly segments: readonly { readonly points: readonly number[]; readonly boundary: boolean; readonly curve: number }[];
}

/** Fetch the artifacts of a finished reconstruction. `named`: the numbers of its nodes, where they are not marks. */
export async function loadResult(api: Api, reconstruction: Reconstruction, named?: readonly number[]): Promise<Result> {
  const { artifacts } = reconstruction;
  const [file, report, curves] = await Promise.all([
    api.artifact<NetworkFile>(artifacts["network.json"] ?? ""),
    api.artifact<Report>(artifacts["report.json"] ?? ""),
    api.curves(reconstruction.session),
  ]);
  const marked = named ?? mergedNumbers(...curves.map((curve) => curve.marks.map((mark) => mark.node)));
  return {
    reconstruction,
    report,
    network: networkFromFile(file, marked),
    gaussMap: networkFromFile({ ...file, points: file.normals }, marked),
    positions: Float32Array.from(file.points.flat()),
    normals: Float32Array.from(file.normals.flat()),
    uncertain: uncertainLines(file),
    meshUrl: artifacts["mesh.glb"],
  };
}

/** The drawn form of a network file: the segments of a scanned curve joined into one polyline where they meet.
 *
 * A file does not name its nodes; `marked` are the numbers that people gave them, in rising order. */
export function networkFromFile(file: NetworkFile, marked: readonly number[] = []): Network {
  const network = new Network();
  let spare = Math.max(0, ...file.segments.map((segment) => segment.curve)) + 1;
  const chains = new Map<number, { points: number[]; boundary: boolean }>();
  for (const { points, boundary, curve } of file.segments) {
    const chain = chains.get(curve);
    if (!chain) chains.set(curve, { points: [...points], boundary });
    else if (chain.points.at(-1) === points[0]) chain.points.push(...points.slice(1));
    else chains.set(spare++, { points: [...points], boundary });
  }
  network.apply({
    type: "live.network",
    curves: [...chains].map(([index, { points, boundary }]) => ({
      index,
      boundary,
      closed: points[0] === points.at(-1),
      ended: true,
      positions: points.flatMap((i) => [...(file.points[i] ?? [])]),
      samples: [],
    })),
    nodes: file.nodes.map((point, i) => ({ node: marked[i] ?? i, position: [...(file.points[point] ?? [0, 0, 0])] })),
  });
  return network;
}

function uncertainLines({ points, segments, uncertainty }: NetworkFile): UncertainLine[] | undefined {
  return (
    uncertainty &&
    segments.map(({ points: line }) => ({
      positions: Float32Array.from(line.flatMap((i) => [...(points[i] ?? [])])),
      uncertainty: Float32Array.from(line, (i) => uncertainty[i] ?? 0),
    }))
  );
}

/** Warnings of both halves of the pipeline. */
export function warningsOf(report: Report): string[] {
  const lists = [report.network?.["warnings"], report.surface?.["warnings"]];
  return lists.flatMap((list) => (Array.isArray(list) ? list.map(String) : []));
}

/** A length that was chosen automatically, m. */
export function chosenLength(report: Report | undefined, name: "prefilter_m" | "stretch_m" | "bend_m"): number | undefined {
  const parameters = report?.network?.["parameters"];
  const value = parameters && typeof parameters === "object" ? (parameters as Record<string, unknown>)[name] : undefined;
  return typeof value === "number" ? value : undefined;
}
