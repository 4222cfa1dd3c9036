/** The page's side when the worker dies, hangs or never starts: a message, a new worker, the same scenes. */
import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";
import { Engine, EngineError } from "../src/engine/client";
import type { Answer, Request } from "../src/engine/protocol";

/** Behaviour of the workers: answers to requests; nothing for those that hang. */
let act: (request: Request, worker: number) => Record<string, unknown> | undefined;
let started: FakeWorker[] = [];
let starts = true;

class FakeWorker extends EventTarget {
  heard: Request[] = [];
  ended = false;
  private readonly number = started.push(this);
  constructor() {
    super();
    queueMicrotask(() => this.say(starts ? { type: "ready", version: "1" } : { type: "broken", message: "no module" }));
  }
  say(data: unknown): void {
    if (!this.ended) this.dispatchEvent(Object.assign(new Event("message"), { data }));
  }
  postMessage(request: Request): void {
    this.heard.push(request);
    const answer = act(request, this.number);
    if (answer) queueMicrotask(() => this.say({ id: request.id, ...answer } as Answer));
  }
  terminate(): void {
    this.ended = true;
  }
}

const fine = (request: Request) =>
  request.type === "load"
    ? { type: "loaded", info: { title: request.toml } }
    : request.type === "set"
      ? { type: "changed", info: {}, live: true }
      : { type: "frame", frame: { index: 1 } };
const crash = { type: "failed", failure: { kind: "crash", message: "the engine stopped: index out of bounds", issues: [] } };

beforeEach(() => {
  (globalThis as unknown as { Worker: unknown }).Worker = FakeWorker;
  act = fine;
  started = [];
  starts = true;
});

const failed = (promise: Promise<unknown>, kind: string) =>
  assert.rejects(promise, (error) => error instanceof EngineError && error.failure.kind === kind);

test("after a crash every world is made again, with its changed values", async () => {
  const engine = new Engine();
  const restarts: string[] = [];
  engine.onrestart = (message) => restarts.push(message);
  await engine.load("a");
  await engine.load("b", { world: 1, overrides: ["time.fps=30"] });
  await engine.set("world.gravity", [0, 0, -1]);
  await engine.set("world.gravity", [0, 0, -2]);
  act = (request, worker) => (request.type === "step" && worker === 1 ? crash : fine(request));
  // Both questions fail; neither hangs.
  await Promise.all([failed(engine.step(), "crash"), failed(engine.step(), "crash")]);
  const frame = await engine.step();
  assert.equal(frame.index, 1);
  assert.ok(started[0].ended && !started[1].ended);
  assert.deepEqual(
    started[1].heard.map((r) => [r.type, r.world, r.type === "load" ? r.toml : r.type === "set" ? r.value : null]),
    [
      ["load", 0, "a"],
      ["set", 0, [0, 0, -2]],
      ["load", 1, "b"],
      ["step", 0, null],
    ],
  );
  assert.deepEqual(restarts, ["the engine stopped: index out of bounds"]);
  engine.close();
});

test("a scene that kills the engine leaves the one before it", async () => {
  const engine = new Engine();
  await engine.load("good");
  act = (request) => (request.type === "load" && request.toml === "bad" ? crash : fine(request));
  await failed(engine.load("bad"), "crash");
  await engine.step();
  assert.deepEqual(
    started[1].heard.map((r) => (r.type === "load" ? r.toml : r.type)),
    ["good", "step"],
  );
  // One that dies again while it is made again is let go.
  act = (request) => (request.type === "load" || request.type === "step" ? crash : fine(request));
  await failed(engine.step(), "crash");
  act = fine;
  await engine.load("other");
  await engine.step();
  assert.ok(started.length <= 5, String(started.length));
  engine.close();
});

test("what hangs is stopped", async () => {
  mock.timers.enable({ apis: ["setTimeout"] });
  try {
    const engine = new Engine();
    act = (request) => (request.type === "step" ? undefined : fine(request));
    await engine.load("a");
    const waits = failed(engine.step(), "crash");
    await new Promise((done) => queueMicrotask(() => done(null)));
    mock.timers.tick(59_000);
    assert.ok(!started[0].ended);
    mock.timers.tick(2_000);
    await waits;
    assert.ok(started[0].ended);
    engine.close();
  } finally {
    mock.timers.reset();
  }
});

test("a worker that never starts is not tried without end", async () => {
  starts = false;
  act = () => undefined;
  const engine = new Engine();
  await failed(engine.load("a"), "crash");
  await new Promise((done) => setTimeout(done, 20));
  const before = started.length;
  assert.ok(before <= 2, String(before));
  // The next question tries again.
  starts = true;
  act = fine;
  assert.equal((await engine.load("a")).title, "a");
  assert.equal(started.length, before + 1);
  engine.close();
});

test("answers of the scene are no crash", async () => {
  const engine = new Engine();
  await engine.load("a");
  act = () => ({ type: "failed", failure: { kind: "scene", message: "line 3: fps", issues: [] } });
  await failed(engine.load("b"), "scene");
  assert.equal(started.length, 1);
  engine.close();
  await failed(engine.step(), "crash");
});
