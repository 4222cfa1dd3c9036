/** A world as the page sees it: plays, keeps frames, goes back, branches. It never waits for the screen, nor the screen for it. */
import { type Branch, back, type Change, gather, merged, type Start, turned } from "./branch";
import { Engine, EngineError } from "./engine/client";
import type { Failure, Files, Frame, Ledger, SceneInfo, Stability, StepReport, Value, Vector } from "./engine/protocol";
import { asked } from "./engine/worth";
import { shipped, viewed } from "./scenes";
import { literal, meshesOf, valueAt } from "./values";
import { Way } from "./way";

let shared: Engine | null = null;
let worlds = 100;
let branches = 1;

/** One worker for all pages; it starts with the first of them. */
export function engine(): Engine {
  return (shared ??= new Engine());
}

/** A scene with every default written out. Throws `EngineError`. */
export async function resolved(toml: string): Promise<Record<string, unknown>> {
  const world = worlds++;
  const { scene } = await engine().load(toml, { world });
  await engine().drop(world);
  return scene;
}

/** Numbers of kept frames take at most this much [bytes]. */
const MEMORY = 192 * 2 ** 20;

/** Frame rates [1/s] at which a scene plays in its own time, and the rate of all others; python/tumble/film.py has them, too. */
const PLAYED = [10, 60];
const WATCHED = 24;

type Events = {
  loaded: SceneInfo;
  /** Other values, the same objects. */
  changed: SceneInfo;
  frame: Frame;
  failed: Failure;
  playing: boolean;
  /** The way that is compared with, or what is known of it, is another. */
  before: Branch | null;
};

/** Preparation of a new branch: committed when it succeeds, undone when it fails. */
interface Parting {
  branch: Branch | null;
  /** The frame that it went back to, and the kept one before it from which it stepped. */
  frame: Frame | null;
  root: number;
  moved: boolean;
}

/** Bytes of mesh files that came with a scene, by the name that the scene gives them. */
export const dropped: Files = {};

export class Session {
  info: SceneInfo | null = null;
  toml = "";
  /** Meshes that came with the scene. */
  private files: Files = {};
  overrides = new Map<string, Value>();
  /** The frame that is shown. */
  shown: Frame | null = null;
  report: StepReport | null = null;
  /** Start of the world, and later changes, in order. */
  start: Start = { overrides: new Map(), scene: {}, hash: "" };
  history: Change[] = [];
  /** Keeps the way that was left for a change, to compare. */
  compares = false;
  /** That way. */
  before: Branch | null = null;
  /** Of the pace at which the scene is watched, as far as the machine keeps up. */
  speed = 1;
  playing = false;
  /** Goes on after the last frame of the scene. */
  endless = false;
  /** Milliseconds that a frame takes the engine, of late. */
  cost = 0;
  wanted: () => string[] | undefined = () => undefined;
  /** Keeps every frame, also where the screen shows fewer. */
  each = false;
  private way = new Way(MEMORY);
  /** The way that was left by going to the start: compared with from the next change on. */
  private left: Branch | null = null;
  private ticking = 0;
  private clock = 0;
  private due = 0;
  private turn: Promise<unknown> = Promise.resolve();
  private listeners: { [K in keyof Events]?: ((event: Events[K]) => void)[] } = {};
  private closed = false;
  /** Counts what ends the way to a frame. */
  private going = 0;
  private busy = false;
  /** Each load counts, so that answers of an older world are not shown. */
  private age = 0;

  private readonly engine = engine();
  /** Each session has a world of its own: one that ends does not take that of the next. */
  readonly world = worlds++;

  on<K extends keyof Events>(name: K, listener: (event: Events[K]) => void): void {
    ((this.listeners[name] ??= []) as ((event: Events[K]) => void)[]).push(listener);
  }

  private tell<K extends keyof Events>(name: K, event: Events[K]): void {
    if (!this.closed) for (const listener of this.listeners[name] ?? []) listener(event);
  }

  /** Runs `act` when those before it are done. */
  private queue<T>(act: () => Promise<T>): Promise<T> {
    const next = this.turn.then(act, act);
    this.turn = next.catch(() => {});
    return next;
  }

  /** A new scene, with meshes of its own where it has some that no page knows. Where it is wrong the old world stays, and this throws. */
  load(toml: string, overrides: [string, Value][] = [], own: Files = this.files): Promise<SceneInfo> {
    return this.queue(async () => {
      const words = overrides.map(([path, value]) => `${path}=${literal(value)}`);
      const files: Files = {};
      const build = () => this.engine.load(toml, { overrides: words, files, world: this.world });
      const info = await build().catch(async (error) => {
        const missing = error instanceof EngineError ? (error.failure.missing ?? []) : [];
        if (!missing.length) throw error;
        const brought = asked(missing, { ...dropped, ...own });
        for (const path of missing) {
          const bytes = brought.get(path) ?? (await viewed(path)) ?? (await shipped(path));
          if (!bytes) throw error;
          files[path] = bytes;
        }
        return build();
      });
      this.age++;
      this.toml = toml;
      this.files = own;
      this.overrides = new Map(overrides);
      this.left = null;
      this.compare(null);
      this.begin(info);
      await this.read();
      return info;
    });
  }

  private begin(info: SceneInfo): void {
    this.info = info;
    this.way = new Way(MEMORY);
    this.start = { overrides: new Map(this.overrides), scene: info.scene, hash: info.hash };
    this.history = [];
    this.report = null;
    this.tell("loaded", info);
  }

  private async read(): Promise<void> {
    const frame = await this.engine.read({ columns: this.wanted() }, this.world);
    this.take(frame);
    this.display(frame);
  }

  private take(frame: Frame): void {
    this.way.take(frame);
    if (frame.report) this.report = frame.report;
  }

  /** Keeps only so many frames, the last ones. */
  trim(count: number): void {
    this.way.trim(count);
  }

  /** A kept frame. */
  readonly frame = (index: number): Frame | undefined => this.way.frame(index);

  get ledgers(): Ledger[] {
    return this.way.ledgers;
  }

  get kept(): number[] {
    return this.way.kept;
  }

  get latest(): number {
    return this.way.last;
  }

  private display(frame: Frame): void {
    this.shown = frame;
    this.tell("frame", frame);
  }

  /** Shows a kept frame, or the one nearest to it. */
  scrub(index: number): void {
    this.pause();
    const near = this.way.near(index);
    if (near) this.display(near);
  }

  get atEnd(): boolean {
    return !this.endless && !!this.info && (this.shown?.index ?? 0) >= this.info.frames;
  }

  play(): void {
    if (this.playing || this.closed || !this.info) return;
    if (this.atEnd) this.scrub(0);
    this.playing = true;
    this.clock = performance.now();
    this.due = 0;
    this.tell("playing", true);
    this.ticking = requestAnimationFrame(this.tick);
  }

  pause(): void {
    if (!this.playing) return;
    this.playing = false;
    cancelAnimationFrame(this.ticking);
    this.tell("playing", false);
  }

  toggle(): void {
    if (this.playing) this.pause();
    else this.play();
  }

  /** Frames a second at which the scene is played: its own, if those can be watched. */
  get rate(): number {
    const fps = this.info?.fps ?? WATCHED;
    return this.speed * (fps >= PLAYED[0] && fps <= PLAYED[1] ? fps : WATCHED);
  }

  private readonly tick = (now: number): void => {
    if (!this.playing || !this.info) return;
    this.ticking = requestAnimationFrame(this.tick);
    // Frames that should have been shown by now; what the machine cannot do is not made up for.
    this.due = Math.min(this.due + ((now - this.clock) / 1000) * this.rate, 4 + this.speed);
    this.clock = now;
    if (this.busy || this.due < 1) return;
    if (this.atEnd) {
      this.pause();
      return;
    }
    const shown = this.shown?.index ?? 0;
    if (shown < this.way.last) {
      this.due -= 1;
      const next = this.kept.find((i) => i > shown);
      if (next !== undefined) this.display(this.way.frame(next)!);
      return;
    }
    const frames = Math.max(1, Math.floor(Math.min(this.due, this.endless ? 8 : this.info.frames - shown)));
    this.due -= frames;
    void this.forward(frames, true).catch((error) => this.fail(error));
  };

  private fail(error: unknown): void {
    this.pause();
    if (error instanceof EngineError) this.tell("failed", error.failure);
    else if (!this.closed) throw error;
  }

  /** Steps the engine. */
  private forward(frames: number, playing: boolean): Promise<void> {
    this.busy = true;
    const age = this.age;
    return this.queue(async () => {
      if (this.closed || (playing && !this.playing)) return;
      if (age !== this.age) return;
      const start = performance.now();
      let frame: Frame | undefined;
      try {
        for (let left = this.each ? frames : 1; left > 0 && performance.now() - start < 40; left--) {
          frame = await this.engine.step({ frames: this.each ? 1 : frames, budget: 40, columns: this.wanted() }, this.world);
          const taken = Math.max(frame.ledgers.length, 1);
          this.cost = this.cost ? 0.8 * this.cost + (0.2 * frame.ms) / taken : frame.ms / taken;
          this.take(frame);
        }
      } finally {
        if (frame) this.display(frame);
      }
    }).finally(() => (this.busy = false));
  }

  /** One frame on. */
  async next(): Promise<void> {
    this.stop();
    const shown = this.shown?.index ?? 0;
    const kept = this.kept.find((i) => i > shown);
    if (kept !== undefined) this.display(this.way.frame(kept)!);
    else await this.forward(1, false).catch((error) => this.fail(error));
  }

  /** One sub-step on: a look inside the frame, until it is whole. What came after the frame that is shown is gone. */
  async substep(): Promise<void> {
    this.stop();
    try {
      await this.cut();
      const substeps = (this.shown?.inside?.substeps ?? 0) + 1;
      const found = await this.queue(() => this.engine.inside(substeps, this.wanted(), this.world));
      if (found) this.display(found);
      else await this.forward(1, false);
    } catch (error) {
      this.fail(error);
    }
  }

  /** One frame back. */
  previous(): void {
    this.stop();
    const shown = this.shown?.index ?? 0;
    // From between two frames to the one before.
    const before = this.shown?.inside ? shown + 1 : shown;
    const kept = this.kept.filter((i) => i < before).pop();
    if (kept !== undefined) this.display(this.way.frame(kept)!);
  }

  /** Ends playing, and the way to a frame that is far. */
  stop(): void {
    this.going++;
    this.pause();
  }

  /** To a frame, stepping as far as needed; `false` where something else was done before it was there. Throws `EngineError`. */
  async goto(index: number, progress: (index: number) => void = () => {}): Promise<boolean> {
    this.stop();
    const own = this.going;
    try {
      while (this.way.last < index && own === this.going) {
        await this.forward(Math.min(index - this.way.last, 8), false);
        progress(this.way.last);
      }
    } catch (error) {
      this.fail(error);
      throw error;
    }
    if (own !== this.going) return false;
    this.scrub(index);
    return true;
  }

  async reset(): Promise<void> {
    this.stop();
    await this.queue(async () => {
      if (this.compares && this.latest > 0) {
        if (this.left) await this.engine.unpark(this.left.id, this.world);
        this.left = await this.park(this.history.every((c) => c.path && !c.frame) ? this.latest : 0);
      }
      const frame = await this.engine.reset(this.wanted(), this.world);
      this.restart(frame);
    }).catch((error) => this.fail(error));
  }

  private restart(frame: Frame): void {
    this.history = back(this.history, 0);
    this.way = new Way(MEMORY);
    this.take(frame);
    this.display(frame);
  }

  /** The way that the world went, kept by the engine, too. */
  private async park(at: number): Promise<Branch> {
    const id = branches++;
    return { ...this.stands(id, await this.engine.park(id, this.world)), at };
  }

  private stands(id: number, hash: string): Branch {
    const { info, overrides, start, history } = this;
    return { id, hash, way: this.way.copy(MEMORY / 2), info: info!, overrides, start, history, changes: [], at: 0 };
  }

  /** Before something is changed at a frame: parks a way that would be lost, or that shall be compared with, and goes to that frame. */
  private async part(at: number, always: boolean): Promise<Parting> {
    const lost = at < this.latest;
    const parting: Parting = { branch: null, frame: null, root: at, moved: false };
    if (!lost && !(always && this.compares && !this.before && !this.left)) return parting;
    parting.branch = await this.park(at);
    if (!lost) return parting;
    parting.moved = true;
    try {
      let frame = await this.engine.restore(at, this.wanted(), this.world);
      parting.root = frame.index;
      while (frame.index < at) {
        const before = frame.index;
        frame = await this.engine.step({ frames: at - before, budget: 1000, columns: this.wanted() }, this.world);
        if (frame.index <= before) break;
      }
      parting.frame = frame;
    } catch (error) {
      await this.undo(parting);
      throw error;
    }
    return parting;
  }

  private async undo({ branch, moved }: Parting): Promise<void> {
    if (branch && moved) await this.engine.take(branch.id, undefined, this.world);
    else if (branch) await this.engine.unpark(branch.id, this.world);
  }

  /** The world went another way: what was kept beyond is no future of it. */
  private settle({ branch, frame, root }: Parting, change: Change): void {
    if (frame) {
      this.history = back(this.history, root);
      this.take(frame);
    }
    this.history = gather(this.history, change);
    const other = branch ?? this.left;
    if (!this.compares) {
      if (branch) void this.engine.unpark(branch.id, this.world).catch(() => {});
    } else if (other) {
      if (branch && this.left) void this.engine.unpark(this.left.id, this.world).catch(() => {});
      this.left = null;
      this.compare({ ...other, at: Math.min(other.at, change.frame), changes: [change] });
    } else if (this.before) this.compare({ ...this.before, changes: merged(this.before.changes, change) });
  }

  private compare(branch: Branch | null): void {
    const old = this.before;
    this.before = branch;
    if (old && branch && old.id !== branch.id) void this.engine.unpark(old.id, this.world).catch(() => {});
    if (old || branch) this.tell("before", branch);
  }

  /** The engine goes to the frame that is shown; what came after it is gone. */
  private cut(): Promise<void> {
    const shown = this.shown?.index ?? 0;
    return this.queue(async () => {
      if (shown >= this.latest) return;
      const { branch, frame, root } = await this.part(shown, false);
      if (branch) await this.engine.unpark(branch.id, this.world);
      if (!frame) return;
      this.history = back(this.history, root);
      if (this.before) this.compare({ ...this.before, at: Math.min(this.before.at, root) });
      this.take(frame);
      this.display(frame);
    });
  }

  /** Before the pointer changes something: the engine goes to the frame that is shown. */
  branch(): Promise<void> {
    const shown = this.shown?.index ?? 0;
    const lost = shown < this.latest;
    return this.queue(async () => {
      const at = lost ? Math.min(shown, this.latest) : this.latest;
      const parting = await this.part(at, false);
      this.settle(parting, { frame: at, path: "", from: null, to: null });
      if (parting.frame) this.display(parting.frame);
    });
  }

  /** Changes a value. Says whether the world goes on from where it stands. Throws `EngineError`, and then nothing has changed. */
  set(path: string, value: Value): Promise<boolean> {
    const shown = this.shown?.index ?? 0;
    const lost = shown < this.latest;
    return this.queue(async () => {
      const at = lost ? Math.min(shown, this.latest) : this.latest;
      const from = valueAt(this.info?.scene, path);
      const parting = await this.part(at, true);
      let changed: { info: SceneInfo; live: boolean };
      try {
        changed = await this.engine.set(path, value, this.world);
      } catch (error) {
        await this.undo(parting);
        throw error;
      }
      const { info, live } = changed;
      this.overrides = new Map(this.overrides);
      // Earlier changes below this path are dropped, and this change becomes the last one.
      for (const old of [...this.overrides.keys()]) if (`${old}.`.startsWith(`${path}.`)) this.overrides.delete(old);
      this.overrides.set(path, value);
      this.settle(parting, { frame: live ? at : 0, path, from, to: value });
      if (live) {
        const shape = (i: SceneInfo | null) =>
          JSON.stringify([i?.objects, i && Object.values(i.topology).map((t) => t.links?.data.length)]);
        const same = shape(this.info) === shape(info);
        this.info = info;
        this.tell(same ? "changed" : "loaded", info);
      } else {
        this.age++;
        this.begin(info);
      }
      await this.read();
      return live;
    });
  }

  /** Takes the way of before again, exactly as it stood; that of now is then the one of before. */
  async takeBefore(): Promise<void> {
    this.pause();
    await this.queue(async () => {
      const shown = this.shown?.index ?? 0;
      await this.swap();
      this.tell("loaded", this.info!);
      this.tell("before", this.before);
      this.scrub(shown);
    }).catch((error) => this.fail(error));
  }

  private async swap(): Promise<void> {
    const { before, left } = this;
    if (!before) return;
    if (left) await this.engine.unpark(left.id, this.world);
    this.left = null;
    const now = this.stands(branches++, await this.engine.hash(this.world));
    const info = await this.engine.take(before.id, now.id, this.world);
    this.age++;
    this.info = info;
    this.way = before.way.copy(MEMORY);
    this.overrides = before.overrides;
    this.start = before.start;
    this.history = before.history;
    this.before = { ...now, at: before.at, changes: turned(before.changes) };
  }

  /** Runs the way of before as far as that of now, while `go` says so of the frames that it comes to. */
  async catchUp(go: (index: number) => boolean): Promise<void> {
    this.pause();
    await this.queue(async () => {
      const end = this.way.frame(this.latest)?.time ?? 0;
      await this.swap();
      let failed: unknown;
      try {
        const dt = this.info!.dt;
        while (!this.closed && (this.way.frame(this.latest)?.time ?? end) < end - 0.5 * dt && go(this.latest)) {
          this.way.take(await this.engine.step({ columns: this.wanted() }, this.world));
        }
      } catch (error) {
        failed = error;
      }
      await this.swap().catch((error) => (failed ??= error));
      this.tell("before", this.before);
      if (failed) throw failed;
    }).catch((error) => this.fail(error));
  }

  /** Forgets the way of before. */
  async forgetBefore(): Promise<void> {
    const { before } = this;
    this.compare(null);
    if (before) await this.queue(() => this.engine.unpark(before.id, this.world));
  }

  grab(object: string, row: number, target: Vector): Promise<void> {
    return this.queue(() => this.engine.grab(object, row, target, this.world));
  }

  release(): Promise<void> {
    return this.queue(() => this.engine.release(this.world));
  }

  stir(gas: string, position: Vector, velocity: Vector, radius: number, density?: number): Promise<void> {
    return this.queue(() => this.engine.stir(gas, position, velocity, radius, density, this.world));
  }

  hash(): Promise<string> {
    return this.queue(() => this.engine.hash(this.world));
  }

  /**
   * History of the shown frame, and its state hash, for sharing. Pointer interaction cannot be replayed: then it is the
   * first frame.
   */
  moment(): Promise<{ frame: number; hash: string; changes: Change[] }> {
    const shown = this.shown?.index ?? 0;
    return this.queue(async () => {
      const frame = Math.min(shown, this.latest);
      if (this.history.some((c) => !c.path && c.frame < frame))
        return { frame: 0, hash: this.start.hash, changes: back(this.history, 0).filter((c) => c.path) };
      const changes = this.history.filter((c) => c.path && c.frame <= frame);
      if (frame === this.latest) return { frame, changes, hash: await this.engine.hash(this.world) };
      const parting = await this.part(frame, false);
      try {
        // Stepped to from a frame before a later change, it is another state.
        const other = this.history.some((c) => c.frame > parting.root && parting.root < frame);
        return { frame, changes, hash: other ? "" : await this.engine.hash(this.world) };
      } finally {
        await this.undo(parting);
      }
    });
  }

  /** All that the world is made of and that was done to it; two of the same are the same. */
  get recipe(): string {
    return JSON.stringify([this.toml, [...this.start.overrides], this.history.map((c) => [c.frame, c.path, c.to])]);
  }

  /** The meshes of the scene that do not ship with tumble. */
  async meshes(): Promise<Files> {
    const found: Files = {};
    for (const path of meshesOf(this.start.scene)) {
      const bytes = this.files[path] ?? dropped[path] ?? (await viewed(path));
      if (bytes) found[path] = bytes;
    }
    return found;
  }

  stability(budget?: number): Promise<Stability[]> {
    return this.queue(() => this.engine.stability(this.world, budget));
  }

  /** Reads the frame again where its columns have changed. */
  refresh(): Promise<void> {
    if ((this.shown?.index ?? 0) < this.way.last) return Promise.resolve();
    return this.queue(() => this.read()).catch((error) => this.fail(error));
  }

  /** After the worker was started anew: its worlds stand at their start. */
  async revived(): Promise<void> {
    this.pause();
    this.age++;
    this.left = null;
    this.compare(null);
    await this.queue(async () => this.restart(await this.engine.read({ columns: this.wanted() }, this.world))).catch((error) =>
      this.fail(error),
    );
  }

  close(): void {
    this.stop();
    this.closed = true;
    this.way = new Way(0);
    this.before = this.left = null;
    void this.queue(() => this.engine.drop(this.world)).catch(() => {});
  }
}
