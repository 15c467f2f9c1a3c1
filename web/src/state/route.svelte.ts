export type Route = { readonly page: "sessions" } | { readonly page: "session"; readonly id: string };

/** The page that an address fragment names: `#/sessions/ID`, anything else is the list. */
export function parseRoute(hash: string): Route {
  const match = /^#\/sessions\/([A-Za-z0-9_-]{1,64})$/.exec(hash);
  return match?.[1] ? { page: "session", id: match[1] } : { page: "sessions" };
}

/** The route of this window, kept up to date. */
export class Router {
  route = $state.raw<Route>({ page: "sessions" });

  constructor(window: Window) {
    const read = (): void => {
      this.route = parseRoute(window.location.hash);
    };
    window.addEventListener("hashchange", read);
    read();
  }
}
