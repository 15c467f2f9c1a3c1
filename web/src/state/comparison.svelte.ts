import { symmetricRange } from "../geometry/colormaps";
import { type Api, ApiProblem, inWords } from "../protocol/api";
import type { Comparison, ComparisonProgress } from "../wire.gen";
import type { Field } from "./fields";

/** How the surface is laid on the truth before it is measured. */
export type Alignment = "rigid" | "similarity" | "none";

export const MESH_FILES = [".obj", ".ply", ".stl", ".glb"] as const;

const MILLIMETRES = 1e3;

/** Whether a file holds a mesh, by its name. */
export function isMesh(file: { readonly name: string }): boolean {
  return MESH_FILES.some((extension) => file.name.toLowerCase().endsWith(extension));
}

/** The surface beside a true one. */
export class ComparisonStore {
  align = $state<Alignment>("rigid");
  progress = $state.raw<ComparisonProgress>();
  found = $state.raw<Comparison>();
  /** Signed distance of every vertex, mm. */
  field = $state.raw<Field>();
  truth = $state.raw<File>();
  problem = $state("");
  #stop: AbortController | undefined;

  constructor(private readonly api: Api) {}

  get busy(): boolean {
    return this.progress !== undefined;
  }

  /** Measure a reconstruction against a true mesh; one that is under way is given up. */
  async compare(reconstruction: string, truth: File): Promise<void> {
    this.clear();
    this.truth = truth;
    this.progress = { type: "progress", stage: "sending", fraction: 0 };
    const stop = (this.#stop = new AbortController());
    try {
      await this.#follow(reconstruction, truth, stop.signal);
    } catch (error) {
      if (!stop.signal.aborted) this.problem = inWords(error);
    } finally {
      if (this.#stop === stop) this.progress = undefined;
    }
  }

  /** Forget the truth, and what is under way. */
  clear(): void {
    this.#stop?.abort();
    this.progress = this.found = this.field = this.truth = undefined;
    this.problem = "";
  }

  async #follow(reconstruction: string, truth: File, signal: AbortSignal): Promise<void> {
    for await (const line of this.api.compare(reconstruction, truth, this.align, signal)) {
      if (signal.aborted) return;
      if (line.type === "progress") this.progress = line;
      else if (line.type === "failure") throw new ApiProblem(422, "It cannot be compared.", line.detail);
      else this.#show(line);
    }
  }

  #show(found: Comparison): void {
    this.found = found;
    const values = Float32Array.from(found.signed_distance, (metres) => MILLIMETRES * metres);
    this.field = { values, range: symmetricRange(values) };
  }
}
