/** A world as the page sees it: plays, keeps frames, goes back, branches. It never waits for the screen, nor the screen for it. */
import { Engine, EngineError } from "./engine/client";
import type { Failure, Files, Frame, Ledger, SceneInfo, Stability, StepReport, Value, Vector } from "./engine/protocol";
import { asset } from "./scenes";

let shared: Engine | null = null;
let worlds = 100;

/** One worker for all pages; it starts with the first of them. */
export function engine(): Engine {
  return (shared ??= new Engine());
}

/** Numbers of kept frames take at most this much [bytes]. */
const MEMORY = 192 * 2 ** 20;

type Events = {
  loaded: SceneInfo;
  frame: Frame;
  failed: Failure;
  playing: boolean;
  /** Frames from this one on are gone: the world went another way. */
  branched: number;
};

const sizeOf = (frame: Frame): number => Object.values(frame.columns).reduce((s, o) => s + Object.values(o).reduce((t, c) => t + c.data.byteLength, 0), 0);

/** Bytes of mesh files that came with a scene, by the name that the scene gives them. */
export const dropped: Files = {};

export class Session {
  info: SceneInfo | null = null;
  toml = "";
  overrides = new Map<string, Value>();
  /** The frame that is shown. */
  shown: Frame | null = null;
  ledgers: Ledger[] = [];
  report: StepReport | null = null;
  /** Simulated time over time, as far as the machine keeps up. */
  speed = 1;
  playing = false;
  /** Goes on after the last frame of the scene. */
  endless = false;
  /** Milliseconds that a frame takes the engine, of late. */
  cost = 0;
  wanted: () => string[] | undefined = () => undefined;
  /** Keeps every frame, also where the screen shows fewer. */
  each = false;
  private frames = new Map<number, Frame>();
  private bytes = 0;
  private last = 0;
  private ticking = 0;
  private clock = 0;
  private due = 0;
  private turn: Promise<unknown> = Promise.resolve();
  private listeners: { [K in keyof Events]?: ((event: Events[K]) => void)[] } = {};
  private closed = false;
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

  /** A new scene. Where it is wrong the old world stays, and this throws. */
  load(toml: string, overrides: [string, Value][] = []): Promise<SceneInfo> {
    return this.queue(async () => {
      const words = overrides.map(([path, value]) => `${path}=${literal(value)}`);
      const files: Files = { ...dropped };
      let info: SceneInfo;
      for (let tries = 0; ; tries++) {
        try {
          info = await this.engine.load(toml, { overrides: words, files, world: this.world });
          break;
        } catch (error) {
          const missing = error instanceof EngineError ? (error.failure.missing ?? []).filter((path) => !(path in files)) : [];
          if (!missing.length || tries > 3) throw error;
          for (const path of missing) {
            const bytes = await asset(path);
            if (!bytes) throw error;
            files[path] = bytes;
          }
        }
      }
      this.age++;
      this.toml = toml;
      this.overrides = new Map(overrides);
      this.begin(info);
      await this.read();
      return info;
    });
  }

  private begin(info: SceneInfo): void {
    this.info = info;
    this.forget(0);
    this.ledgers = [];
    this.report = null;
    this.last = 0;
    this.tell("loaded", info);
  }

  private async read(): Promise<void> {
    const frame = await this.engine.read({ columns: this.wanted() }, this.world);
    this.take(frame);
    this.display(frame);
  }

  private take(frame: Frame): void {
    if (frame.index < this.last) this.forget(frame.index + 1);
    const old = this.frames.get(frame.index);
    if (old) this.bytes -= sizeOf(old);
    this.frames.set(frame.index, frame);
    this.bytes += sizeOf(frame);
    this.last = frame.index;
    const first = frame.index - frame.ledgers.length + 1;
    frame.ledgers.forEach((ledger, i) => (this.ledgers[Math.max(first, 0) + i] = ledger));
    this.ledgers.length = frame.index + 1;
    if (frame.report) this.report = frame.report;
    // Every second one goes, oldest first, the start excepted, until the rest fits.
    if (this.bytes > MEMORY) {
      const indices = [...this.frames.keys()].sort((a, b) => a - b);
      for (let i = 1; i < indices.length - 60 && this.bytes > 0.75 * MEMORY; i += 2) this.drop(indices[i]);
      for (let i = 2; i < indices.length - 30 && this.bytes > MEMORY; i += 2) this.drop(indices[i]);
    }
  }

  /** Keeps only so many frames, the last ones. */
  trim(count: number): void {
    for (const old of [...this.frames.keys()]) if (old < this.last - count) this.drop(old);
    // Nor the books of long ago.
    for (let i = this.last - 3000; i >= 0 && this.ledgers[i]; i--) delete this.ledgers[i];
  }

  private drop(index: number): void {
    const frame = this.frames.get(index);
    if (!frame) return;
    this.bytes -= sizeOf(frame);
    this.frames.delete(index);
  }

  private forget(from: number): void {
    for (const index of [...this.frames.keys()]) if (index >= from) this.drop(index);
  }

  /** A kept frame. */
  readonly frame = (index: number): Frame | undefined => this.frames.get(index);

  get kept(): number[] {
    return [...this.frames.keys()].sort((a, b) => a - b);
  }

  get latest(): number {
    return this.last;
  }

  get memory(): number {
    return this.bytes;
  }

  private display(frame: Frame): void {
    this.shown = frame;
    this.tell("frame", frame);
  }

  /** Shows a kept frame, or the one nearest to it. */
  scrub(index: number): void {
    this.pause();
    const kept = this.kept;
    if (!kept.length) return;
    const near = kept.reduce((a, b) => (Math.abs(b - index) < Math.abs(a - index) ? b : a));
    this.display(this.frames.get(near)!);
  }

  get atEnd(): boolean {
    return !this.endless && !!this.info && (this.shown?.index ?? 0) >= this.info.frames;
  }

  play(): void {
    if (this.playing || !this.info) return;
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

  private readonly tick = (now: number): void => {
    if (!this.playing || !this.info) return;
    this.ticking = requestAnimationFrame(this.tick);
    // Frames that should have been shown by now; what the machine cannot do is not made up for.
    this.due = Math.min(this.due + ((now - this.clock) / 1000) * this.info.fps * this.speed, 4 + this.speed);
    this.clock = now;
    if (this.busy || this.due < 1) return;
    if (this.atEnd) {
      this.pause();
      return;
    }
    const shown = this.shown?.index ?? 0;
    if (shown < this.last) {
      this.due -= 1;
      const next = this.kept.find((i) => i > shown);
      if (next !== undefined) this.display(this.frames.get(next)!);
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
    this.pause();
    const shown = this.shown?.index ?? 0;
    const kept = this.kept.find((i) => i > shown);
    if (kept !== undefined) this.display(this.frames.get(kept)!);
    else await this.forward(1, false).catch((error) => this.fail(error));
  }

  /** One frame back. */
  previous(): void {
    this.pause();
    const shown = this.shown?.index ?? 0;
    const kept = this.kept.filter((i) => i < shown).pop();
    if (kept !== undefined) this.display(this.frames.get(kept)!);
  }

  /** To a frame, stepping as far as needed. Throws `EngineError`. */
  async goto(index: number, progress: (index: number) => void = () => {}): Promise<void> {
    this.pause();
    try {
      while (this.last < index && !this.closed) {
        await this.forward(Math.min(index - this.last, 8), false);
        progress(this.last);
      }
    } catch (error) {
      this.fail(error);
      throw error;
    }
    this.scrub(index);
  }

  async reset(): Promise<void> {
    this.pause();
    await this.queue(async () => {
      const frame = await this.engine.reset(this.wanted(), this.world);
      this.forget(0);
      this.ledgers = [];
      this.last = 0;
      this.take(frame);
      this.tell("branched", 0);
      this.display(frame);
    }).catch((error) => this.fail(error));
  }

  /** Before something is changed: the engine goes to the frame that is shown, and what came after it is gone. */
  async branch(): Promise<void> {
    const shown = this.shown?.index ?? 0;
    if (shown >= this.last) return;
    await this.queue(async () => {
      let frame = await this.engine.restore(shown, this.wanted(), this.world);
      while (frame.index < shown) {
        const before = frame.index;
        frame = await this.engine.step({ frames: shown - before, columns: this.wanted() }, this.world);
        if (frame.index <= before) break;
      }
      this.take(frame);
      this.tell("branched", frame.index);
      this.display(frame);
    });
  }

  /** Changes a value. Says whether the world goes on from where it stands. Throws `EngineError`. */
  async set(path: string, value: Value): Promise<boolean> {
    await this.branch();
    return this.queue(async () => {
      const { info, live } = await this.engine.set(path, value, this.world);
      this.overrides.set(path, value);
      if (live) {
        const same = JSON.stringify(this.info?.objects) === JSON.stringify(info.objects);
        this.info = info;
        if (!same) this.tell("loaded", info);
        await this.read();
      } else {
        this.age++;
        this.begin(info);
        await this.read();
      }
      return live;
    });
  }

  grab(object: string, row: number, target: Vector, stiffness?: number): Promise<void> {
    return this.queue(() => this.engine.grab(object, row, target, stiffness, this.world));
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

  stability(): Promise<Stability[]> {
    return this.queue(() => this.engine.stability(this.world));
  }

  /** Reads the frame again where its columns have changed. */
  refresh(): Promise<void> {
    if ((this.shown?.index ?? 0) < this.last) return Promise.resolve();
    return this.queue(() => this.read()).catch((error) => this.fail(error));
  }

  /** After the worker was started anew: its worlds stand at their start. */
  async revived(): Promise<void> {
    this.pause();
    this.age++;
    await this.queue(async () => {
      this.forget(0);
      this.ledgers = [];
      this.last = 0;
      await this.read();
    }).catch((error) => this.fail(error));
  }

  close(): void {
    this.pause();
    this.closed = true;
    this.frames.clear();
    void this.queue(() => this.engine.drop(this.world)).catch(() => {});
  }
}

/** A value as TOML writes it. */
export function literal(value: Value): string {
  if (typeof value === "string") return JSON.stringify(value);
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  if (typeof value === "object") return `{ ${Object.entries(value).map(([k, v]) => `${k} = ${literal(v)}`).join(", ")} }`;
  return String(value);
}
