/** Start of a scene page: a bundled scene, a file, a link; and how it is opened. */

import { EngineError } from "./engine/client";
import type { Files, Value } from "./engine/protocol";
import { opened } from "./files";
import { sceneOf } from "./scenes";
import { engine, resolved, type Session } from "./session";
import { LONGEST, pack, type Shared, toFile, unpack } from "./share";
import { alike, literal, valueIn, written } from "./values";

export interface Source {
  text: string;
  overrides: [string, Value][];
  /** Meshes that came with it. */
  files: Files;
  shared: Shared | null;
  name: string;
  /** ROW/NAME of a scene that ships. */
  id: string | null;
}

const assigned = (text: string): [string, Value] => {
  const cut = text.indexOf("=");
  return [text.slice(0, cut), valueIn(text.slice(cut + 1))];
};

const sharedSource = (shared: Shared, files: Files, name: string): Source => ({
  text: shared.text,
  overrides: shared.overrides.map(assigned),
  files,
  shared,
  name,
  id: null,
});

/** From the address behind "#/scene/" or "#/". Throws where there is nothing. */
export async function source(rest: string): Promise<Source> {
  if (rest.startsWith("s/")) {
    const shared = await unpack(rest.slice(2)).catch((error) => {
      throw new Error(`The link is damaged: ${error.message}. Copy all of it once more.`);
    });
    return sharedSource(shared, {}, "shared");
  }
  const file = /^file\/(\d+)$/.exec(rest);
  if (file) {
    const own = opened[Number(file[1]) - 1];
    if (!own) throw new Error("This file was opened in an earlier session; open it again.");
    const name = own.name.replace(/\.\w+$/, "");
    return own.shared
      ? sharedSource(own.shared, own.files, name)
      : { text: own.toml, overrides: [], files: own.files, shared: null, name, id: null };
  }
  const known = sceneOf(rest);
  if (!known) throw new Error(`There is no scene "${rest}".`);
  return { text: await known.text(), overrides: [], files: {}, shared: null, name: known.name, id: known.id };
}

const STOPPED = "stopped before the shared frame";

/**
 * Loads a source and brings it to where it was shared. The text counts where it still means the scene that was shared; where defaults have
 * changed since, the resolved scene does. Answers with what is to be said of that.
 */
export async function begin(session: Session, start: Source, progress: (frame: number) => void): Promise<string> {
  const { shared } = start;
  let told = "";
  const load = async () => {
    await session.load(written(shared!.scene), [], start.files);
    told = "defaults have changed since, so all keys are written out";
  };
  try {
    const info = await session.load(start.text, start.overrides, start.files);
    if (shared && !alike(info.scene, shared.scene)) await load();
  } catch (error) {
    if (!shared || told || !(error instanceof EngineError) || error.failure.kind !== "scene") throw error;
    await load().catch(() => {
      throw error;
    });
  }
  if (!shared) return "";
  const { compares } = session;
  session.compares = false;
  try {
    for (const { frame, path, value } of shared.changes) {
      if (!(await session.goto(frame, progress))) return STOPPED;
      await session.set(path, value);
    }
  } finally {
    session.compares = compares;
  }
  if (shared.frame > session.latest && !(await session.goto(shared.frame, progress))) return STOPPED;
  return told;
}

/** The address, on this page, of a scene that was made here. */
export async function addressed(text: string): Promise<string> {
  const scene = await resolved(text);
  return `#/s/${await pack({ version: engine().version, text, overrides: [], scene, changes: [], frame: 0, hash: "" })}`;
}

/** A scene as it stands, for a link, or for a file where it has meshes of its own or is too long. */
export async function toShare(session: Session, version: string): Promise<{ link: string } | { file: Blob; reason: string }> {
  const { frame, hash, changes } = await session.moment();
  const { scene, overrides } = session.start;
  const whole: Shared = {
    version,
    text: session.toml,
    overrides: [...overrides].map(([path, value]) => `${path}=${literal(value)}`),
    scene,
    changes: changes.map(({ frame, path, to }) => ({ frame, path, value: to! })),
    frame,
    hash,
  };
  const meshes = await session.meshes();
  if (Object.keys(meshes).length) return { file: await toFile(whole, meshes), reason: "A link cannot contain custom meshes" };
  const link = await pack(whole);
  return link.length <= LONGEST ? { link } : { file: await toFile(whole, {}), reason: "The scene is too large for a link" };
}
