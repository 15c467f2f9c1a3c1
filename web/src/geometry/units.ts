/** Readings for people: every number with its unit. */

/** A length in the unit that suits it: 0.4 mm, 12.3 mm, 45.6 cm, 1.23 m. */
export function formatLength(metres: number): string {
  const size = Math.abs(metres);
  if (size < 0.1) return `${significant(metres * 1e3)} mm`;
  if (size < 1) return `${significant(metres * 1e2)} cm`;
  return `${significant(metres)} m`;
}

/** A round length, such as a scale bar has, without zeros after it: 20 cm, 0.5 mm. */
export function formatRound(metres: number): string {
  const [value, unit] = formatLength(metres).split(" ");
  return `${Number(value)} ${unit}`;
}

export function formatSeconds(seconds: number): string {
  if (seconds < 0.0995) return `${significant(seconds * 1e3)} ms`;
  return seconds < 100 ? `${significant(seconds)} s` : `${Math.round(seconds / 60)} min`;
}

export function formatAngle(radians: number): string {
  return `${((radians * 180) / Math.PI).toFixed(1)}°`;
}

export function formatCount(count: number): string {
  return count.toLocaleString("en").replaceAll(",", "\u202f");
}

/** A count with its noun: 1 curve, 2 curves. */
export function counted(count: number, noun: string): string {
  return `${formatCount(count)} ${noun}${count === 1 ? "" : "s"}`;
}

/** Three significant digits, never in exponent form. */
export function significant(value: number): string {
  if (value === 0) return "0";
  const digits = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return value.toFixed(Math.min(digits, 6));
}

/** The largest of 1, 2, 5 times a power of ten that is not above `limit`. */
export function roundDown(limit: number): number {
  const power = 10 ** Math.floor(Math.log10(limit));
  const lead = limit / power;
  return power * (lead >= 5 ? 5 : lead >= 2 ? 2 : 1);
}
