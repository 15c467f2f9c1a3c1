/** A change that can be taken back. */
export interface Command {
  /** In words: "curve 2 removed". */
  readonly label: string;
  run(): Promise<void>;
  revert(): Promise<void>;
}

/** Commands in the order in which they were done; each can be taken back and done again. */
export class History {
  done = $state.raw<readonly Command[]>([]);
  undone = $state.raw<readonly Command[]>([]);

  get last(): Command | undefined {
    return this.done.at(-1);
  }

  async do(command: Command): Promise<void> {
    await command.run();
    this.done = [...this.done, command];
    this.undone = [];
  }

  async undo(): Promise<void> {
    const command = this.done.at(-1);
    if (!command) return;
    await command.revert();
    this.done = this.done.slice(0, -1);
    this.undone = [...this.undone, command];
  }

  async redo(): Promise<void> {
    const command = this.undone.at(-1);
    if (!command) return;
    await command.run();
    this.undone = this.undone.slice(0, -1);
    this.done = [...this.done, command];
  }
}
