/** Does one thing at a time; of the wishes that come meanwhile only the newest is kept. */
export class Latest<Wish> {
  #waiting: { readonly wish: Wish } | undefined;
  #busy = false;

  constructor(private readonly work: (wish: Wish) => Promise<void>) {}

  async want(wish: Wish): Promise<void> {
    this.#waiting = { wish };
    if (this.#busy) return;
    this.#busy = true;
    try {
      while (this.#waiting) {
        const next: Wish = this.#waiting.wish;
        this.#waiting = undefined;
        await this.work(next);
      }
    } finally {
      this.#busy = false;
    }
  }
}
