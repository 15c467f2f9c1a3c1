import type { EditStore } from "./editing.svelte";
import type { SessionStore } from "./session.svelte";
import type { Shortcut } from "./shortcuts";
import type { ViewStore } from "./view.svelte";

/** What a pointer does to curves and nodes, by key. */
export function editKeys(store: SessionStore, edit: EditStore, view: ViewStore): readonly Shortcut[] {
  const far = (event: KeyboardEvent): number => (event.shiftKey ? 10 : 1);
  return [
    { keys: " ", label: "Space", does: "mark a node while scanning (number pad: with that number)", run: () => void edit.markNow() },
    { keys: "e", does: "edit nodes with the pointer", run: () => edit.toggle() },
    { keys: "]", does: "choose the next curve", run: () => (view.highlighted = next(indices(store), view.highlighted, 1)) },
    { keys: "[", does: "choose the curve before", run: () => (view.highlighted = next(indices(store), view.highlighted, -1)) },
    { keys: ".", does: "choose the next node", run: () => (edit.node = next(store.nodes, edit.node, 1)) },
    { keys: ",", does: "choose the node before", run: () => (edit.node = next(store.nodes, edit.node, -1)) },
    {
      keys: "arrowright",
      label: "→",
      does: "move the node, or the place, on along the curve (Shift: further)",
      run: (event) => void edit.step(far(event), view.highlighted),
    },
    { keys: "arrowleft", label: "←", does: "move it back", run: (event) => void edit.step(-far(event), view.highlighted) },
    { keys: "a", does: "mark a node at the place on the curve", run: () => void edit.markAtCursor() },
    { keys: "d", does: "split the chosen node's mark on the curve off", run: () => void edit.splitChosen(view.highlighted) },
    {
      keys: "delete",
      label: "Del",
      does: "delete the chosen node",
      run: () => void (edit.node !== undefined && edit.deleteNode(edit.node)),
    },
    { keys: "escape", label: "Esc", does: "let go", run: () => letGo(edit, view) },
    { keys: "u", does: "take back the last edit", run: () => void store.undo() },
    { keys: "y", does: "do it again", run: () => void store.redo() },
  ];
}

function letGo(edit: EditStore, view: ViewStore): void {
  edit.cancel();
  if (edit.on) edit.toggle();
  view.highlighted = undefined;
}

function indices(store: SessionStore): number[] {
  return store.curves.map(({ index }) => index);
}

/** The element after (or before) one of a list, going round; the first (or last) when there is none yet. */
export function next(list: readonly number[], from: number | undefined, by: 1 | -1): number | undefined {
  const place = from === undefined ? -1 : list.indexOf(from);
  if (place < 0) return by > 0 ? list[0] : list.at(-1);
  return list[(place + by + list.length) % list.length];
}
