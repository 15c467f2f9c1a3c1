/** More than a hand moves a wheel, m/s: a faster counter is not believed. */
const TOP_SPEED = 3;
/** Readings in a row that contradict the last one but agree with each other: then it is the counter that restarted. */
const REPEATS = 5;

interface Count {
  readonly ticks: number;
  readonly time: number;
}

/** Believes a wheel counter only if a hand could have turned the wheel that far since the last reading; goes on over
 * restarts of the counter, so that a curve being scanned stays whole. */
export class Odometer {
  #offset = 0;
  #believed: Count | undefined;
  #doubted: Count | undefined;
  #repeats = 0;

  /** Ticks in one turn of the wheel, and its circumference, m. */
  constructor(
    private readonly ticksPerTurn: number,
    private readonly circumference: number,
  ) {}

  /** The counter [turns, ticks] continued over restarts; undefined while it is not believed. Time in s. */
  follow([turns, small]: readonly [number, number], time: number): [number, number] | undefined {
    const now = { ticks: turns * this.ticksPerTurn + small, time };
    if (!this.#reachable(this.#believed, now)) {
      this.#repeats = this.#reachable(this.#doubted, now) ? this.#repeats + 1 : 1;
      this.#doubted = now;
      if (this.#repeats < REPEATS) return undefined;
      this.#offset += (this.#believed ?? now).ticks - now.ticks;
    }
    this.#believed = now;
    this.#doubted = undefined;
    this.#repeats = 0;
    const total = now.ticks + this.#offset;
    const whole = Math.floor(total / this.ticksPerTurn);
    return [whole, total - whole * this.ticksPerTurn];
  }

  #reachable(from: Count | undefined, to: Count): boolean {
    if (!from) return this.#doubted === undefined;
    // One turn more: the two integers of a counter may be read just before and just after a turn is complete.
    const turns = (TOP_SPEED * (to.time - from.time)) / this.circumference + 1;
    return Math.abs(to.ticks - from.ticks) <= turns * this.ticksPerTurn;
  }
}
