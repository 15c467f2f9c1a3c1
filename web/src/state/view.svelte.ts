import type { Vector } from "../geometry/vectors";
import type { LookName } from "../scene/looks";

export type Theme = "light" | "dark";

/** A point of a curve: the curve's number, the point's number within it, and where it is (m). */
export interface Pointed {
  readonly curve: number;
  readonly point: number;
  readonly position: Vector;
}

/** How the person looks at the object; belongs to this browser, not to the session. */
export class ViewStore {
  follow = $state(true);
  look = $state<LookName>("shaded");
  curves = $state(true);
  nodes = $state(true);
  grid = $state(true);
  surface = $state(true);
  normals = $state(false);
  spikes = $state(false);
  tubes = $state(false);
  plot = $state(false);
  /** True while two points are being picked; the points so far, m. */
  measuring = $state(false);
  measured = $state.raw<readonly Vector[]>([]);
  gaussMap = $state(false);
  /** The point that the plot's cursor is at. */
  pointed = $state.raw<Pointed>();
  highlighted = $state<number>();
  help = $state(false);
  theme = $state<Theme>("light");
  readonly reducedMotion: boolean;

  constructor(
    private readonly root: HTMLElement,
    private readonly memory: Storage,
    matches: (query: string) => boolean,
  ) {
    this.reducedMotion = matches("(prefers-reduced-motion: reduce)");
    const chosen = memory.getItem("theme");
    const preferred = matches("(prefers-color-scheme: dark)") ? "dark" : "light";
    this.setTheme(chosen === "light" || chosen === "dark" ? chosen : preferred);
  }

  toggleMeasuring(): void {
    this.measuring = !this.measuring;
    this.measured = [];
  }

  /** One more end of the measured distance; a third begins a new one. */
  measure(point: Vector): void {
    this.measured = this.measured.length === 2 ? [point] : [...this.measured, point];
  }

  toggleTheme(): void {
    this.setTheme(this.theme === "light" ? "dark" : "light");
    this.memory.setItem("theme", this.theme);
  }

  private setTheme(theme: Theme): void {
    this.theme = theme;
    this.root.dataset["theme"] = theme;
  }
}
