import { type Api, inWords } from "../protocol/api";
import type { Session } from "../wire.gen";
import { nameFor, putIn } from "./files";

const UNDO_SECONDS = 6;

/** The list of sessions. A deleted one stays on the server until nobody can want it back any more. */
export class SessionsStore {
  all = $state.raw<readonly Session[]>();
  search = $state("");
  problem = $state("");
  leaving = $state.raw<Session>();
  /** Whether whoever looks may also change things. */
  mayEdit = $state(true);
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly api: Api) {}

  /** Sessions that match the search, newest first; undefined until the server answered. */
  get shown(): readonly Session[] | undefined {
    const words = this.search.trim().toLowerCase();
    return this.all
      ?.filter((s) => s.id !== this.leaving?.id && `${s.name} ${s.id}`.toLowerCase().includes(words))
      .sort((a, b) => b.created.localeCompare(a.created));
  }

  async load(): Promise<void> {
    await this.#attempt(async () => {
      const [rights, all] = await Promise.all([this.api.rights(), this.api.sessions()]);
      this.mayEdit = rights.role === "owner";
      this.all = all;
    });
  }

  /** A new session; undefined when the server refused (see `problem`). */
  async create(name: string): Promise<Session | undefined> {
    return this.#attempt(() => this.api.createSession(name));
  }

  /** A new session with these files in it, named after the first; nothing is left behind when one is refused. */
  async open(files: readonly File[]): Promise<Session | undefined> {
    const [first] = files;
    if (!first) return undefined;
    return this.#attempt(async () => {
      const session = await this.api.createSession(nameFor(first.name));
      try {
        for (const file of files) await putIn(this.api, session.id, file);
      } catch (error) {
        await this.api.deleteSession(session.id);
        throw new Error(`${first.name} was not opened: ${inWords(error)}`, { cause: error });
      }
      return session;
    });
  }

  async rename(session: Session, name: string): Promise<void> {
    await this.#attempt(async () => {
      const renamed = await this.api.renameSession(session.id, name);
      this.all = this.all?.map((s) => (s.id === renamed.id ? renamed : s));
    });
  }

  /** Take a session off the list; it is deleted for good after a few seconds without `undo`. */
  async remove(session: Session): Promise<void> {
    await this.flush();
    this.leaving = session;
    this.#timer = setTimeout(() => void this.flush(), 1000 * UNDO_SECONDS);
  }

  undo(): void {
    clearTimeout(this.#timer);
    this.leaving = undefined;
  }

  /** Delete now what is waiting to be deleted. */
  async flush(): Promise<void> {
    clearTimeout(this.#timer);
    const session = this.leaving;
    if (!session) return;
    await this.#attempt(async () => {
      await this.api.deleteSession(session.id);
      this.all = this.all?.filter((s) => s.id !== session.id);
    });
    this.leaving = undefined;
  }

  async #attempt<T>(work: () => Promise<T>): Promise<T | undefined> {
    try {
      const value = await work();
      this.problem = "";
      return value;
    } catch (error) {
      this.problem = inWords(error);
      return undefined;
    }
  }
}
