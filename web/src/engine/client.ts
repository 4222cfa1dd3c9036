/** The page's side: questions as promises, and a new worker where the old one died or hangs. */

import { literal } from "../values";
import type { Answer, Cure, Failure, Files, Frame, Notice, Question, SceneInfo, Stability, Value, Vector } from "./protocol";

/** Answer to a failed request. */
export class EngineError extends Error {
  constructor(readonly failure: Failure) {
    super(failure.message);
    this.name = "EngineError";
  }
}

/** Milliseconds after which a worker that does not answer is taken for dead. */
const PATIENCE = { load: 30_000, step: 60_000, cures: 60_000, other: 30_000 };

const GONE: Failure = { kind: "scene", message: "this branch is no longer stored", issues: [] };
const CLOSED: Failure = { kind: "crash", message: "the engine was closed", issues: [] };

interface Waiting {
  question: Question;
  give: (answer: Answer) => void;
  fail: (error: EngineError) => void;
}

/** Source of a world, to rebuild it. */
interface Made {
  toml: string;
  overrides: string[];
  files: Files;
  sets: { path: string; value: Value }[];
}

interface FrameOptions {
  columns?: string[];
  hash?: boolean;
}

export class Engine {
  /** Called when the worker died and every world stands at its start again. */
  onrestart: (message: string) => void = () => {};
  /** Version of the engine, once it is there. */
  version = "";

  /** None where it died before it could answer anything: the next question starts another. */
  private worker: Worker | undefined;
  private ready = false;
  private next = 1;
  private readonly waiting = new Map<number, Waiting>();
  private readonly made = new Map<number, Made>();
  /** Sources of parked branches. */
  private readonly parked = new Map<number, Made & { world: number }>();
  private watch: ReturnType<typeof setTimeout> | undefined;
  private reviving: Promise<void> | undefined;
  private closed = false;

  constructor() {
    this.worker = this.start();
  }

  /** Checks and builds a scene. The old world goes on where this fails. */
  async load(toml: string, options: { overrides?: string[]; files?: Files; world?: number } = {}): Promise<SceneInfo> {
    const { overrides = [], files = {}, world = 0 } = options;
    const { info } = (await this.ask({ type: "load", toml, overrides, files, world })) as Answer & { type: "loaded" };
    this.forget(world);
    this.made.set(world, { toml, overrides, files, sets: [] });
    return info;
  }

  /** Simulates frames, as many as fit into `budget` [ms]; answers with the last. */
  step(options: FrameOptions & { frames?: number; budget?: number } = {}, world = 0): Promise<Frame> {
    return this.frame({ type: "step", ...options, world });
  }

  /** The state after so many sub-steps of the next frame; `null` where it has no more. */
  async inside(substeps: number, columns?: string[], world = 0): Promise<Frame | null> {
    const answer = await this.ask({ type: "inside", substeps, columns, world });
    return answer.type === "frame" ? answer.frame : null;
  }

  /** The frame as it stands. */
  read(options: FrameOptions = {}, world = 0): Promise<Frame> {
    return this.frame({ type: "read", ...options, world });
  }

  /** Back to the first frame. */
  reset(columns?: string[], world = 0): Promise<Frame> {
    return this.frame({ type: "reset", columns, world });
  }

  /** To the kept frame at or before this one. */
  restore(frame: number, columns?: string[], world = 0): Promise<Frame> {
    return this.frame({ type: "restore", frame, columns, world });
  }

  /** Overrides a value of the scene and goes on; `live: false` if the world had to start anew. */
  async set(path: string, value: Value, world = 0): Promise<{ info: SceneInfo; live: boolean }> {
    const answer = (await this.ask({ type: "set", path, value, world })) as Answer & { type: "changed" };
    const made = this.made.get(world);
    if (made) this.made.set(world, { ...made, sets: [...made.sets.filter((set) => set.path !== path), { path, value }] });
    return { info: answer.info, live: answer.live };
  }

  /** Pulls a mass to a point, or the one that is held to another point. */
  async grab(object: string, row: number, target: Vector, world = 0): Promise<void> {
    await this.ask({ type: "grab", object, row, target, world });
  }

  async release(world = 0): Promise<void> {
    await this.ask({ type: "release", world });
  }

  /** Pushes a gas around a point. */
  async stir(gas: string, position: Vector, velocity: Vector, radius: number, density?: number, world = 0): Promise<void> {
    await this.ask({ type: "stir", gas, position, velocity, radius, density, world });
  }

  async hash(world = 0): Promise<string> {
    return ((await this.ask({ type: "hash", world })) as Answer & { type: "hash" }).hash;
  }

  /** Of those systems for which it is found within `budget` [ms]. */
  async stability(world = 0, budget?: number): Promise<Stability[]> {
    return ((await this.ask({ type: "stability", world, budget })) as Answer & { type: "stability" }).stability;
  }

  async cures(world = 0): Promise<Cure[]> {
    return ((await this.ask({ type: "cures", world })) as Answer & { type: "cures" }).cures;
  }

  /** Fetches the engine of a precision before a scene needs it. */
  async warm(precision: "single" | "double"): Promise<void> {
    await this.ask({ type: "warm", precision });
  }

  async schema(): Promise<Record<string, unknown>> {
    return ((await this.ask({ type: "schema" })) as Answer & { type: "schema" }).schema;
  }

  /** Keeps the way that a world went under a number; answers with the hash of the state in which it stands. */
  async park(as: number, world = 0): Promise<string> {
    const { hash } = (await this.ask({ type: "park", as, world })) as Answer & { type: "hash" };
    const made = this.made.get(world);
    if (made) this.parked.set(as, { ...made, world });
    return hash;
  }

  /** Back to a way that was parked, as it stood; the one of now is parked in its turn where `as` is given. */
  async take(from: number, as?: number, world = 0): Promise<SceneInfo> {
    const made = this.parked.get(from);
    if (!made) throw new EngineError(GONE);
    const { toml, files } = made;
    const overrides = [...made.overrides, ...made.sets.map(({ path, value }) => `${path}=${literal(value)}`)];
    const { info } = (await this.ask({ type: "take", from, as, toml, overrides, files, world })) as Answer & { type: "changed" };
    const now = this.made.get(world);
    if (as !== undefined && now) this.parked.set(as, { ...now, world });
    this.parked.delete(from);
    this.made.set(world, made);
    return info;
  }

  /** Forgets a way that was parked. */
  async unpark(as: number, world = 0): Promise<void> {
    this.parked.delete(as);
    await this.ask({ type: "unpark", as, world });
  }

  /** Forgets a world. */
  async drop(world: number): Promise<void> {
    this.forget(world);
    await this.ask({ type: "drop", world });
  }

  private forget(world: number): void {
    this.made.delete(world);
    for (const [as, made] of [...this.parked]) if (made.world === world) this.parked.delete(as);
  }

  /** Ends the worker; what waits fails. */
  close(): void {
    this.closed = true;
    clearTimeout(this.watch);
    this.worker?.terminate();
    this.failAll(CLOSED);
  }

  /** Any question; rejects with an `EngineError`. */
  async ask(question: Question): Promise<Answer> {
    await this.reviving;
    return this.send(question);
  }

  private async frame(question: Question): Promise<Frame> {
    return ((await this.ask(question)) as Answer & { type: "frame" }).frame;
  }

  private send(question: Question): Promise<Answer> {
    if (this.closed) return Promise.reject(new EngineError(CLOSED));
    return new Promise((give, fail) => {
      const id = this.next++;
      this.waiting.set(id, { question, give, fail });
      this.worker ??= this.start();
      this.worker.postMessage({ ...question, id });
      if (this.waiting.size === 1) this.look();
    });
  }

  private start(): Worker {
    this.ready = false;
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    worker.addEventListener("message", (event: MessageEvent<Answer | Notice>) => this.hear(event.data));
    worker.addEventListener("error", (event) => this.died(event.message || "the worker could not be started"));
    return worker;
  }

  private hear(answer: Answer | Notice): void {
    if (answer.type === "ready") {
      this.version = answer.version;
      this.ready = true;
      return;
    }
    if (answer.type === "broken") return this.died(answer.message);
    const waiting = this.waiting.get(answer.id);
    if (!waiting) return;
    if (answer.type === "failed" && answer.failure.kind === "crash") return this.died(answer.failure.message);
    this.waiting.delete(answer.id);
    this.look();
    if (answer.type === "failed") waiting.fail(new EngineError(answer.failure));
    else waiting.give(answer);
  }

  /** Watches the question that is answered next. */
  private look(): void {
    clearTimeout(this.watch);
    const [first] = this.waiting.values();
    if (!first) return;
    const { type } = first.question;
    const patience = type === "load" || type === "step" || type === "cures" ? PATIENCE[type] : PATIENCE.other;
    this.watch = setTimeout(() => this.died(`the engine did not respond for ${patience / 1000} s and was stopped`), patience);
  }

  private failAll(failure: Failure): void {
    const waiting = [...this.waiting.values()];
    this.waiting.clear();
    clearTimeout(this.watch);
    for (const { fail } of waiting) fail(new EngineError(failure));
  }

  /** Starts a new worker and makes every world again that had been made, those that kill it once more left out. */
  private died(message: string): void {
    if (this.closed) return;
    this.worker?.terminate();
    this.worker = this.ready ? this.start() : undefined;
    this.failAll({ kind: "crash", message, issues: [] });
    this.parked.clear();
    if (this.reviving) return;
    this.reviving = (async () => {
      for (const [world, { toml, overrides, files, sets }] of [...this.made]) {
        try {
          await this.send({ type: "load", toml, overrides, files, world });
          for (const { path, value } of sets) await this.send({ type: "set", path, value, world });
        } catch {
          this.made.delete(world);
        }
      }
    })().finally(() => {
      this.reviving = undefined;
      this.onrestart(message);
    });
  }
}
