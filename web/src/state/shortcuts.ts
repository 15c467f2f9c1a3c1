export interface Shortcut {
  readonly keys: string;
  readonly does: string;
  readonly run: () => void;
}

/** Call the shortcut whose key was pressed, unless a person is typing or a modifier is held; true if there was one. */
export function dispatchKey(event: KeyboardEvent, shortcuts: readonly Shortcut[]): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return false;
  const shortcut = shortcuts.find((candidate) => candidate.keys === event.key.toLowerCase());
  shortcut?.run();
  return shortcut !== undefined;
}

function isTyping(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  const field = target instanceof HTMLInputElement && !["checkbox", "radio", "range"].includes(target.type);
  return field || target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement;
}
