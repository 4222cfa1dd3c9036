/** The engine's side: worlds in WebAssembly, asked by messages, one at a time. It computes only when asked. */

import { Kept } from "./kept";
import { together } from "./measures";
import type { Answer, Columns, Failure, Files, Frame, Ledger, Notice, Request, SceneInfo, Sight, StepReport } from "./protocol";
import { readable } from "./worth";

type Module = typeof import("./pkg/single");
type World = InstanceType<Module["World"]>;

/** Milliseconds that a frame may take before the worker gives up on it. */
const FRAME_LIMIT = 30_000;
/** Milliseconds that the estimates of stability may take. */
const STABILITY_LIMIT = 4_000;
/** Milliseconds that the search for cures may take. */
const CURE_LIMIT = 20_000;
/** Bytes of snapshots of one world. */
const KEEP = 192 * 2 ** 20;

/** Bytes of snapshots of a way that is parked. */
const KEEP_PARKED = 64 * 2 ** 20;

/** A way that a world went before it went another: its snapshots, and how it stood. */
interface Parked {
  kept: Kept;
  end: Uint8Array;
}

interface Running {
  world: World;
  info: SceneInfo;
  kept: Kept;
  /** By the page's numbers. */
  parked: Map<number, Parked>;
}

const worlds = new Map<number, Running>();
const modules: Partial<Record<"single" | "double", Promise<Module>>> = {};

/** The engine of a precision: a module of its own, fetched when it is first needed. */
function engine(precision: "single" | "double"): Promise<Module> {
  modules[precision] ??= (async () => {
    try {
      const module = precision === "single" ? await import("./pkg/single") : ((await import("./pkg/double")) as unknown as Module);
      await module.default();
      postMessage({ type: "ready", version: module.version() } satisfies Notice);
      return module;
    } catch (error) {
      postMessage({ type: "broken", message: String(error) } satisfies Notice);
      throw error;
    }
  })();
  return modules[precision];
}

/** What a text seems to ask for, before an engine is here that reads it. */
function seeming(toml: string, overrides: string[]): "single" | "double" {
  const set = overrides.findLast((o) => /^\s*precision\s*=/.test(o));
  return /^\s*"?precision"?\s*[=:]\s*["']?double\b/m.test(set ?? toml) ? "double" : "single";
}

function running(world: number): Running {
  const found = worlds.get(world);
  if (!found) throw new Asked("no scene is loaded");
  return found;
}

/** A question that makes no sense; nothing is broken. */
class Asked extends Error {}

function info(world: World): SceneInfo {
  const topology = world.topology() as unknown as Columns;
  return { ...(JSON.parse(world.info()) as SceneInfo), topology };
}

function sight(world: World, time: number): Sight | null {
  return JSON.parse(world.sight(time)) as Sight | null;
}

function ledger(world: World): Ledger {
  return JSON.parse(world.ledger()) as Ledger;
}

function frame(at: Running, asked: { columns?: string[]; hash?: boolean }, done?: Partial<Frame>): Frame {
  const { world, kept } = at;
  return {
    index: world.index(),
    time: world.time(),
    columns: world.columns(asked.columns ?? at.info.columns) as unknown as Columns,
    sight: sight(world, world.time()),
    ledgers: done?.ledgers?.length ? done.ledgers : [ledger(world)],
    report: done?.report ?? null,
    ms: done?.ms ?? 0,
    kept: kept.frames(),
    ...(asked.hash ? { hash: world.hash() } : {}),
  };
}

function keep({ world, kept }: Running): void {
  kept.add(world.index(), () => world.save());
}

async function build(toml: string, overrides: string[], files: Files): Promise<World> {
  const first = seeming(toml, overrides);
  const precision = (await engine(first)).precision(toml, overrides) === "double" ? "double" : "single";
  const module = await engine(precision);
  return new module.World(toml, overrides, new Map(Object.entries(files)));
}

function park(at: Running): Parked {
  return { kept: at.kept.copy(KEEP_PARKED), end: at.world.save() };
}

async function take(request: Request & { type: "take" }): Promise<SceneInfo> {
  const at = running(request.world ?? 0);
  const parked = at.parked.get(request.from);
  if (!parked) throw new Asked("this branch is no longer stored");
  const world = await build(request.toml, request.overrides, request.files);
  try {
    world.restore(parked.end);
  } catch (thrown) {
    world.free();
    throw thrown;
  }
  at.parked.delete(request.from);
  if (request.as !== undefined) at.parked.set(request.as, park(at));
  at.world.free();
  at.world = world;
  at.kept = parked.kept.copy(KEEP);
  at.info = info(world);
  return at.info;
}

async function load(request: Request & { type: "load" }): Promise<SceneInfo> {
  const world = await build(request.toml, request.overrides ?? [], request.files ?? {});
  const number = request.world ?? 0;
  const at: Running = { world, info: info(world), kept: new Kept(KEEP), parked: new Map() };
  keep(at);
  // The old one is let go only now: had the new one failed, it would go on.
  worlds.get(number)?.world.free();
  worlds.set(number, at);
  return at.info;
}

function step(request: Request & { type: "step" }): Frame {
  const at = running(request.world ?? 0);
  const start = performance.now();
  const ledgers: Ledger[] = [];
  let report: StepReport | null = null;
  const count = Math.max(1, Math.floor(request.frames ?? 1));
  for (let i = 0; i < count; i++) {
    if (i > 0 && performance.now() - start >= (request.budget ?? Infinity)) break;
    const next = JSON.parse(at.world.step(FRAME_LIMIT)) as StepReport;
    report = report ? together(report, next) : next;
    ledgers.push(ledger(at.world));
    keep(at);
  }
  return frame(at, request, { ledgers, report, ms: performance.now() - start });
}

function inside(request: Request & { type: "inside" }): Frame | null {
  const at = running(request.world ?? 0);
  const start = performance.now();
  const found = at.world.inside(request.substeps, request.columns ?? at.info.columns, FRAME_LIMIT) as
    | { columns: Columns; about: string }
    | undefined;
  if (!found) return null;
  const { system, step, time, ledger } = JSON.parse(found.about) as { system: string; step: number; time: number; ledger: Ledger };
  return {
    ...frame(at, { columns: [] }, { ledgers: [ledger], ms: performance.now() - start }),
    columns: found.columns,
    time,
    sight: sight(at.world, time),
    inside: { substeps: request.substeps, system, step },
  };
}

async function answer(request: Request): Promise<Answer> {
  const { id } = request;
  const number = request.world ?? 0;
  switch (request.type) {
    case "load":
      return { id, type: "loaded", info: await load(request) };
    case "step":
      return { id, type: "frame", frame: step(request) };
    case "inside": {
      const found = inside(request);
      return found ? { id, type: "frame", frame: found } : { id, type: "done" };
    }
    case "read":
      return { id, type: "frame", frame: frame(running(number), request) };
    case "reset":
    case "restore": {
      const at = running(number);
      at.world.restore(at.kept.at(request.type === "reset" ? 0 : request.frame));
      return { id, type: "frame", frame: frame(at, request) };
    }
    case "set": {
      const at = running(number);
      const live = at.world.set(request.path, JSON.stringify(request.value));
      at.info = info(at.world);
      // Frames stored after this moment are no longer its future; the moment itself is stored as it is now.
      if (live) at.kept.cut(at.world.index());
      else at.kept = new Kept(KEEP);
      keep(at);
      return { id, type: "changed", info: at.info, live };
    }
    case "grab": {
      const at = running(number);
      at.world.grab(request.object, request.row, Float64Array.from(request.target));
      at.kept.cut(at.world.index());
      return { id, type: "done" };
    }
    case "release":
      running(number).world.release();
      return { id, type: "done" };
    case "stir": {
      const at = running(number);
      const { gas, position, velocity, radius, density = 0 } = request;
      at.world.stir(gas, Float64Array.from(position), Float64Array.from(velocity), radius, density);
      at.kept.cut(at.world.index());
      return { id, type: "done" };
    }
    case "hash":
      return { id, type: "hash", hash: running(number).world.hash() };
    case "stability":
      return { id, type: "stability", stability: JSON.parse(running(number).world.stability(request.budget ?? STABILITY_LIMIT)) };
    case "cures":
      return { id, type: "cures", cures: JSON.parse(running(number).world.cures(CURE_LIMIT)) };
    case "warm":
      await engine(request.precision);
      return { id, type: "done" };
    case "schema":
      return { id, type: "schema", schema: JSON.parse((await (modules.single ?? modules.double ?? engine("single"))).schema()) };
    case "park": {
      const at = running(number);
      at.parked.set(request.as, park(at));
      return { id, type: "hash", hash: at.world.hash() };
    }
    case "take":
      return { id, type: "changed", info: await take(request), live: true };
    case "unpark":
      running(number).parked.delete(request.as);
      return { id, type: "done" };
    case "drop":
      worlds.get(number)?.world.free();
      worlds.delete(number);
      return { id, type: "done" };
  }
}

/** Exception of the engine: its own failures are JSON; anything else has killed it. */
function failure(thrown: unknown, toml?: string): Failure {
  if (typeof thrown === "string") return readable(JSON.parse(thrown) as Failure, toml);
  if (thrown instanceof Asked) return { kind: "scene", message: thrown.message, issues: [] };
  const panic = (globalThis as { tumblePanic?: string }).tumblePanic;
  const message = panic ?? (thrown instanceof Error ? thrown.message : String(thrown));
  return { kind: "crash", message: `the engine stopped: ${message}`, issues: [] };
}

/** The buffers of all columns of an answer: they move to the page. */
function buffers(answer: Answer): ArrayBuffer[] {
  const columns = answer.type === "frame" ? answer.frame.columns : undefined;
  if (!columns) return [];
  return Object.values(columns).flatMap((object) => Object.values(object).map((column) => column.data.buffer as ArrayBuffer));
}

let turn: Promise<void> = Promise.resolve();

addEventListener("message", (event: MessageEvent<Request>) => {
  turn = turn.then(async () => {
    let reply: Answer;
    try {
      reply = await answer(event.data);
    } catch (thrown) {
      reply = { id: event.data.id, type: "failed", failure: failure(thrown, event.data.type === "load" ? event.data.toml : "") };
    }
    postMessage(reply, { transfer: buffers(reply) });
  });
});
