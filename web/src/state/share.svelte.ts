import { type Api, inWords } from "../protocol/api";
import type { Token } from "../wire.gen";

type Role = Token["role"];

const DAY = 86400;
/** s; a phone scans today, who looks may look for a month. */
const LASTS: Readonly<Record<Role, number>> = { device: DAY, viewer: 30 * DAY, owner: DAY };

/** A link that lets somebody in. */
export interface SharedLink {
  readonly role: Role;
  readonly url: string;
}

/** Address that opens a session for whoever has the token: the scan page for a device, else the session's page. */
export function linkFor(role: Role, token: string, session: string, origin: string): string {
  return role === "device" ? `${origin}/scan.html?token=${token}#${session}` : `${origin}/?token=${token}#/sessions/${session}`;
}

/** Whom else a session is shared with. */
export class ShareStore {
  tokens = $state.raw<readonly Token[]>([]);
  /** The newest link; its token is told this once. */
  link = $state.raw<SharedLink>();
  problem = $state("");

  constructor(
    private readonly api: Api,
    private readonly session: string,
  ) {}

  async load(): Promise<void> {
    await this.#attempt(() => Promise.resolve());
  }

  /** Let somebody in with this role. */
  async make(role: Role): Promise<void> {
    await this.#attempt(async () => {
      const wanted = { role, session: this.session, name: role === "device" ? "phone" : "link", expires_in: LASTS[role] };
      const { token } = await this.api.createToken(wanted);
      this.link = { role, url: linkFor(role, token, this.session, window.location.origin) };
    });
  }

  async revoke(token: Token): Promise<void> {
    await this.#attempt(() => this.api.revokeToken(token.id));
  }

  async #attempt(work: () => Promise<void>): Promise<void> {
    this.problem = "";
    try {
      await work();
      this.tokens = await this.api.tokens(this.session);
    } catch (error) {
      this.problem = inWords(error);
    }
  }
}
