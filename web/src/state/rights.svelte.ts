import type { Api } from "../protocol/api";
import type { Rights } from "../wire.gen";

/** What whoever sits before this page may do; nothing until the server has said so. */
export class RightsStore {
  held = $state.raw<Rights>();

  get mayEdit(): boolean {
    return this.held?.role === "owner";
  }

  async load(api: Api): Promise<void> {
    this.held = await api.rights();
  }
}
