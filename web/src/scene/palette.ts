import { Color } from "three";
import type { Inks } from "./picture";

/** The colours of the scene: the same tokens that the panels use. */
export interface Palette {
  readonly background: Color;
  readonly grid: Color;
  readonly boundary: Color;
  readonly interior: Color;
  readonly accent: Color;
  readonly surface: Color;
  readonly inside: Color;
}

/** Read the tokens (CSS custom properties) as they are now. */
export function readPalette(element: Element): Palette {
  const style = getComputedStyle(element);
  const token = (name: string): Color => new Color(style.getPropertyValue(`--${name}`).trim());
  return {
    background: token("view"),
    grid: token("grid"),
    boundary: token("curve-boundary"),
    interior: token("curve-interior"),
    accent: token("accent"),
    surface: token("surface"),
    inside: token("surface-inside"),
  };
}

/** The colours of labels in a picture, from the same tokens. */
export function readInks(element: Element): Inks {
  const style = getComputedStyle(element);
  const token = (name: string): string => style.getPropertyValue(`--${name}`).trim();
  return { ink: token("ink"), paper: token("raised"), accent: token("accent") };
}
