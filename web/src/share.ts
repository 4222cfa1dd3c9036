/** Links that hold a scene: packed, in the part of the address that never leaves the browser. */

export interface Shared {
  /** Version of tumble whose bits these are. */
  version: string;
  toml: string;
  overrides: string[];
  /** Frame and state hash at which it was shared. */
  frame: number;
  hash: string;
}

/** Longer links are cut by some programs that pass them on. */
export const LONGEST = 30_000;
/** A link must not unpack to more than this [bytes]. */
const LARGEST = 2_000_000;

async function through(data: Uint8Array, stream: CompressionStream | DecompressionStream, most = Infinity): Promise<Uint8Array> {
  const reader = new Blob([data as Uint8Array<ArrayBuffer>]).stream().pipeThrough(stream).getReader();
  const parts: Uint8Array[] = [];
  let size = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    size += value.length;
    if (size > most) {
      await reader.cancel();
      throw new Error("the link holds more than a scene");
    }
    parts.push(value);
  }
  const out = new Uint8Array(size);
  let at = 0;
  for (const part of parts) {
    out.set(part, at);
    at += part.length;
  }
  return out;
}

export async function pack(shared: Shared): Promise<string> {
  const text = JSON.stringify([1, shared.version, shared.toml, shared.overrides, shared.frame, shared.hash]);
  const bytes = await through(new TextEncoder().encode(text), new CompressionStream("deflate-raw"));
  let binary = "";
  for (const b of bytes) binary += String.fromCharCode(b);
  return btoa(binary).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
}

/** Throws where a link is damaged. */
export async function unpack(link: string): Promise<Shared> {
  if (link.length > 20 * LONGEST) throw new Error("the link is too long");
  const bytes = Uint8Array.from(atob(link.replace(/-/g, "+").replace(/_/g, "/")), (c) => c.charCodeAt(0));
  const tree: unknown = JSON.parse(new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate-raw"), LARGEST)));
  const ok = Array.isArray(tree) && tree[0] === 1 && typeof tree[1] === "string" && typeof tree[2] === "string" && Array.isArray(tree[3]) && tree[3].every((o) => typeof o === "string") && Number.isInteger(tree[4]) && tree[4] >= 0 && typeof tree[5] === "string";
  if (!ok) throw new Error("the link does not hold a scene");
  const [, version, toml, overrides, frame, hash] = tree as [number, string, string, string[], number, string];
  return { version, toml, overrides, frame, hash };
}
