/** Sharing: a scene with all of its values, what was changed while it ran, and the bits that came of it; as a link or as a file. */
import type { Files, Value } from "./engine/protocol";

export interface Shared {
  /** Version of tumble whose bits these are. */
  version: string;
  /** The scene as it was written, TOML or JSON. */
  text: string;
  /** Values beside the text: "time.fps=30". */
  overrides: string[];
  /** The scene that these are, resolved: every default written out, meshes with the hash of their content. */
  scene: Record<string, unknown>;
  /** Values that were changed at frames. */
  changes: { frame: number; path: string; value: Value }[];
  /** Frame and state hash at which it was shared. */
  frame: number;
  hash: string;
}

/** Longer links are cut by some programs that pass them on. */
export const LONGEST = 30_000;
/** Limits of the unpacked size of a link or a file [bytes]; python/tumble/cli/view.py has the first one, too. */
const LARGEST = { link: 2_000_000, file: 96 * 2 ** 20 };
/** Meshes of a file [bytes]; the engine takes no more. */
const MESHES = 64 * 2 ** 20;
const CHANGES = 10_000;
const FRAMES = 1_000_000;

/** Folder of all versions of the laboratory on this host. */
export const root = (): string => location.origin + location.pathname.replace(/[^/]*$/, "").replace(/v\/[^/]+\/$/, "");

/** The address that opens a packed scene with the version that made it. */
export const addressOf = (version: string, packed: string): string => `${root()}v/${version}/#/s/${packed}`;

/** What is wrong with a link or a file, in words that follow "it is damaged: ". */
class Damage extends Error {}

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
      throw new Damage("it contains more than a scene may have");
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

/** The tree of what is shared; the version stands where one looks first. */
const tree = ({ version, ...rest }: Shared) => ({ tumble: version, ...rest });

/** What a reader of packed bytes found; those of the browser fail in words of their own. */
async function whole<T>(read: () => Promise<T>): Promise<T> {
  try {
    return await read();
  } catch (error) {
    throw error instanceof Damage ? error : new Damage("part of it is missing or has been changed");
  }
}

const table = (x: unknown): x is Record<string, unknown> => !!x && typeof x === "object" && !Array.isArray(x);
const frame = (x: unknown): x is number => Number.isInteger(x) && (x as number) >= 0 && (x as number) <= FRAMES;

/** Checks a tree that anyone may have written. */
function checked(found: unknown): Shared {
  if (!table(found)) throw new Damage("it does not contain a scene");
  const { tumble: version, text, overrides, scene, changes, frame: last, hash } = found;
  const complete =
    typeof version === "string" &&
    typeof text === "string" &&
    typeof hash === "string" &&
    frame(last) &&
    table(scene) &&
    Array.isArray(overrides) &&
    overrides.every((o) => typeof o === "string") &&
    Array.isArray(changes) &&
    changes.length <= CHANGES &&
    changes.every(
      (c) => table(c) && frame(c.frame) && c.frame <= last && typeof c.path === "string" && c.value !== null && c.value !== undefined,
    );
  if (!complete) throw new Damage("it does not contain a scene");
  return { version, text, overrides, scene, changes, frame: last, hash } as Shared;
}

/** The address after "#/s/". */
export async function pack(shared: Shared): Promise<string> {
  const bytes = await through(new TextEncoder().encode(JSON.stringify(tree(shared))), new CompressionStream("deflate-raw"));
  return base64(bytes).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
}

/** Throws where a link is damaged. */
export async function unpack(link: string): Promise<Shared> {
  if (link.length > 20 * LONGEST) throw new Damage("it exceeds the maximum length of a link");
  return whole(async () => {
    const bytes = bytesOf(link.replace(/-/g, "+").replace(/_/g, "/"));
    return checked(JSON.parse(new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate-raw"), LARGEST.link))));
  });
}

/** The same as a file, with meshes that no other machine has: JSON, packed as gzip does. */
export async function toFile(shared: Shared, meshes: Files): Promise<Blob> {
  const size = Object.values(meshes).reduce((sum, bytes) => sum + bytes.length, 0);
  if (size > MESHES) throw new Error(`the meshes have ${Math.ceil(size / 2 ** 20)} MiB; a file can hold ${MESHES / 2 ** 20} MiB`);
  const held = Object.fromEntries(Object.entries(meshes).map(([path, bytes]) => [path, base64(bytes)]));
  const packed = await through(new TextEncoder().encode(JSON.stringify({ ...tree(shared), meshes: held })), new CompressionStream("gzip"));
  return new Blob([packed as Uint8Array<ArrayBuffer>], { type: "application/gzip" });
}

/** Throws where a file is damaged. */
export function fromFile(data: Uint8Array): Promise<{ shared: Shared; meshes: Files }> {
  return whole(async () => {
    const found: unknown = JSON.parse(new TextDecoder().decode(await through(data, new DecompressionStream("gzip"), LARGEST.file)));
    const shared = checked(found);
    const { meshes } = found as { meshes?: unknown };
    if (!table(meshes) || !Object.values(meshes).every((text) => typeof text === "string"))
      throw new Damage("it does not contain its meshes");
    return {
      shared,
      meshes: Object.fromEntries(Object.entries(meshes as Record<string, string>).map(([path, text]) => [path, bytesOf(text)])),
    };
  });
}

function base64(bytes: Uint8Array): string {
  let binary = "";
  for (let i = 0; i < bytes.length; i += 0x8000) binary += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return btoa(binary);
}

function bytesOf(text: string): Uint8Array {
  const binary = atob(text);
  const out = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) out[i] = binary.charCodeAt(i);
  return out;
}
