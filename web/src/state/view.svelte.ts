import type { LookName } from "../scene/looks";

export type Theme = "light" | "dark";

/** How the person looks at the object; belongs to this browser, not to the session. */
export class ViewStore {
  follow = $state(true);
  look = $state<LookName>("shaded");
  curves = $state(true);
  nodes = $state(true);
  grid = $state(true);
  surface = $state(true);
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

  toggleTheme(): void {
    this.setTheme(this.theme === "light" ? "dark" : "light");
    this.memory.setItem("theme", this.theme);
  }

  private setTheme(theme: Theme): void {
    this.theme = theme;
    this.root.dataset["theme"] = theme;
  }
}
