import type { Api } from "../protocol/api";

/** Characters within which a network JSON says what it is. */
const HEAD = 400;

/** Whether a file is a network JSON; anything else is for the server to tell apart. */
export async function isNetwork(file: File): Promise<boolean> {
  return /\.json$/i.test(file.name) || (await file.slice(0, HEAD).text()).includes('"tracemesh-network"');
}

/** Put a file into a session: a network as a reconstruction to be spanned, anything else as if a device had sent it. */
export async function putIn(api: Api, session: string, file: File): Promise<void> {
  await ((await isNetwork(file)) ? api.openNetwork(session, file) : api.upload(session, file));
}

/** A session's name for a file: its own, without what says its kind. */
export function nameFor(file: string): string {
  return file.replace(/(\.network)?\.[^.]*$/, "") || file;
}
