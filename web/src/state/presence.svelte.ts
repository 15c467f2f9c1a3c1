import type { LiveDevice } from "../wire.gen";

/** Who is connected to a session: devices that record into it, and people who watch. */
export class PresenceStore {
  devices = $state.raw<readonly LiveDevice[]>([]);
  /** Pages that show the session, this one included. */
  watchers = $state(0);

  hear(...heard: readonly LiveDevice[]): void {
    const others = this.devices.filter((old) => !heard.some((device) => device.recording === old.recording));
    this.devices = [...others, ...heard].sort((a, b) => a.recording.localeCompare(b.recording));
  }

  isLive(recording: string): boolean {
    return this.devices.some((device) => device.recording === recording && device.state === "live");
  }
}
