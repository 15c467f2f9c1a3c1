/** A name that nothing else has: a prefix and 64 random bits. Works on plain HTTP, unlike crypto.randomUUID. */
export function newName(prefix: string): string {
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  return `${prefix}-${[...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}
