export interface Shortcut {
  /** `KeyboardEvent.key` in lower case. */
  readonly keys: string;
  /** How the sheet of keys calls it; unless given, the key itself. */
  readonly label?: string;
  readonly does: string;
  readonly run: (event: KeyboardEvent) => void;
}

/** Call the shortcut whose key was pressed, unless a person is typing, a modifier is held, or the key belongs to the
 * control that has the focus; true if there was one. */
export function dispatchKey(event: KeyboardEvent, shortcuts: readonly Shortcut[]): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey || isTaken(event)) return false;
  const shortcut = shortcuts.find((candidate) => candidate.keys === event.key.toLowerCase());
  if (!shortcut) return false;
  event.preventDefault();
  shortcut.run(event);
  return true;
}

/** What the sheet of keys calls a shortcut. */
export function keyName({ keys, label }: Shortcut): string {
  return label ?? keys.toUpperCase();
}

/** The number on a key of the number pad, whatever the lock does. */
export function padNumber(event: KeyboardEvent): number | undefined {
  const digit = /^Numpad(\d)$/.exec(event.code)?.[1];
  return digit === undefined || isTaken(event) ? undefined : Number(digit);
}

function isTaken({ target, key }: KeyboardEvent): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLInputElement && target.type === "range") return key.startsWith("Arrow");
  if (key === "Escape" && target.closest("dialog")) return true;
  if (key === " ") return target.matches("button, a, summary, input");
  const field = target instanceof HTMLInputElement && !["checkbox", "radio"].includes(target.type);
  const chooses = target instanceof HTMLInputElement && target.type === "radio" && key.startsWith("Arrow");
  return field || chooses || target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement;
}
