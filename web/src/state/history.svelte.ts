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
  #turn: Promise<void> = Promise.resolve();

  get last(): Command | undefined {
    return this.done.at(-1);
  }

  do(command: Command): Promise<void> {
    return this.plan(() => Promise.resolve(command));
  }

  /** Do what is found to be done once everything before it is done; nothing if that is undefined. */
  plan(make: () => Promise<Command | undefined>): Promise<void> {
    return this.#inTurn(async () => {
      const command = await make();
      if (!command) return;
      await command.run();
      this.done = [...this.done, command];
      this.undone = [];
    });
  }

  undo(): Promise<void> {
    return this.#inTurn(async () => {
      const command = this.done.at(-1);
      if (!command) return;
      await command.revert();
      this.done = this.done.slice(0, -1);
      this.undone = [...this.undone, command];
    });
  }

  redo(): Promise<void> {
    return this.#inTurn(async () => {
      const command = this.undone.at(-1);
      if (!command) return;
      await command.run();
      this.undone = this.undone.slice(0, -1);
      this.done = [...this.done, command];
    });
  }

  /** One after another: a key that is pressed twice takes back two commands. */
  #inTurn(work: () => Promise<void>): Promise<void> {
    const turn = this.#turn.then(work);
    this.#turn = turn.catch(() => undefined);
    return turn;
  }
}
