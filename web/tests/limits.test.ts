/** Wrong and hostile scenes: a message that says what and where, and the engine goes on. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { test } from "node:test";
import { Kept } from "../src/engine/kept";
import type { Failure, SceneInfo } from "../src/engine/protocol";
import { asked, readable } from "../src/engine/worth";
import { ofSteps, range } from "../src/ranges";
import { TEXTS, told } from "../src/texts";
import { Way } from "../src/way";

const PKG = resolve(import.meta.dirname, "../src/engine/pkg");
const engine = await import(`${PKG}/single.js`);
const { memory } = engine.initSync({ module: readFileSync(`${PKG}/single_bg.wasm`) });

const BALL = `version = 1\n[[particles]]\nname = "p"\nposition = [[0.0, 0.0, 1.0]]\n`;
const SHEET = `version = 1\n[time]\nfps = 24\n[[sheet]]\nname = "s"\nsize = [1.0, 1.0]\nresolution = [8, 8]\npin = ["corner 0 0"]\n[sheet.links]\nstructural = { modulus = 10.0 }\n`;
const GAS = `version = 1\ndimension = 2\n[[system]]\nname = "air"\nmethod = "gas"\n[[gas]]\nname = "g"\n[gas.box]\nsize = [1.0, 1.0, 1.0]\nresolution = 32\n[gas.smoke]\n`;

function made(toml: string, overrides: string[] = [], files = new Map<string, Uint8Array>()) {
  return new engine.World(toml, overrides, files);
}

function failure(act: () => unknown): Failure {
  try {
    act();
  } catch (thrown) {
    assert.equal(typeof thrown, "string", `the engine died: ${(globalThis as { tumblePanic?: string }).tumblePanic ?? thrown}`);
    return JSON.parse(thrown as string) as Failure;
  }
  throw new Error("nothing failed");
}

test("a mistake has its line and its cure", () => {
  const found = failure(() => made(SHEET.replace("fps = 24", "fps = -24")));
  assert.equal(found.kind, "scene");
  assert.equal(found.line, 3);
  assert.equal(found.path, "time.fps");
  assert.match(found.message, /expected > 0/);
  assert.equal(failure(() => made("version = 1\nx = = 2\n")).line, 2);
  // Errors found only when it is built, too.
  assert.equal(failure(() => made(SHEET.replace("corner 0 0", "corner 7 7"))).line, 8);
});

test("what is too large is refused before any memory is taken", () => {
  for (const [toml, override] of [
    [SHEET, "sheet.s.resolution=[100000, 100000]"],
    [GAS, "gas.g.box.resolution=1000000"],
    [BALL, "particles.p.cloud={ shape = 'box', count = 4000000000, size = [1, 1, 1] }"],
  ] as const) {
    const found = failure(() => made(toml, [override]));
    assert.ok(found.kind === "limit" || found.kind === "scene", found.message);
    assert.ok(found.message.length > 20);
  }
  assert.equal(failure(() => made(SHEET, ["sheet.s.resolution=[3000, 3000]"])).kind, "limit");
  assert.equal(failure(() => made("#".repeat(9 << 20))).kind, "limit");
});

test("what lives for longer than its scene takes no memory for it", () => {
  const emitter = 'version = 1\ntime.frames = 24\n[[emitter]]\nname = "e"\nfrom.box.size = [1, 1, 1]\nrate = 10\nlifetime = ';
  const before = memory.buffer.byteLength;
  for (const lifetime of ["1e7", "1e9", "1e300"]) {
    const world = made(emitter + lifetime);
    for (let i = 0; i < 30; i++) world.step(60_000);
    world.free();
  }
  assert.ok(memory.buffer.byteLength - before < 2 ** 24, `${memory.buffer.byteLength - before} bytes`);
});

test("what is found by long search ends in time", () => {
  const stars =
    'version = 1\nworld.gravity = [0, 0, 0]\n[[force]]\nkind = "gravitation"\nconstant = 1\nsoftening = 0.1\n[[galaxy]]\nname = "g"\nstars = 12000\nmass = 1\nlength = 1\nradius = 0.01\n';
  const world = made(stars);
  const start = performance.now();
  assert.deepEqual(JSON.parse(world.stability(50)), []);
  world.grab("g", 7, [0, 0, 0], undefined);
  // Nothing is told of how long it may be, but a whole search takes more than a minute.
  assert.ok(performance.now() - start < 30_000);
  world.free();
});

test("more colliders than can be drawn are refused", () => {
  const many = (n: number) =>
    BALL + Array.from({ length: n }, (_, i) => `[[collider]]\nname = "c${i}"\nshape.floor.height = -${i}\n`).join("");
  made(many(10)).free();
  const found = failure(() => made(many(2001)));
  assert.equal(found.kind, "limit");
  assert.match(found.message, /2001 colliders.* 2000/);
});

test("hostile text is only text", () => {
  assert.match(failure(() => made(BALL, [`${Array(100_000).fill("a").join(".")}=1`])).message, /nested too deeply/);
  assert.equal(failure(() => made(BALL + "[[force]]\n".repeat(3000))).issues.length, 1000);
  const deep = `version = 1\nx = ${"[".repeat(100_000)}${"]".repeat(100_000)}\n`;
  assert.equal(failure(() => made(deep)).kind, "scene");
  assert.equal(failure(() => made(`{"version": 1, "x": ${'{"a":'.repeat(1000)}1${"}".repeat(1000)}}`)).kind, "scene");
  for (const value of ["nan", "inf", "1e999", '"x"']) {
    assert.equal(failure(() => made(BALL.replace("1.0]]", `${value}]]`))).kind, "scene");
  }
  const odd = BALL.replace('"p"', '"__proto__"').replace("version = 1", 'version = 1\ntitle = "<img src=x onerror=alert(1)>"');
  const world = made(odd);
  const columns = world.columns(["position"]);
  assert.ok(Object.keys(columns).includes("__proto__"));
  assert.equal((JSON.parse(world.info()) as SceneInfo).title, "<img src=x onerror=alert(1)>");
  world.free();
});

test("broken meshes and missing ones are named", () => {
  const net = `version = 1\n[[net]]\nname = "n"\nmesh = { path = "a.obj" }\n`;
  assert.deepEqual(failure(() => made(net)).missing, ["a.obj"]);
  for (const bytes of ["", "f 1 2 3\n", "v 0 0 0\nf 1 1 9999999999\n", "v nan 0 0\n"]) {
    assert.equal(failure(() => made(net, [], new Map([["a.obj", new TextEncoder().encode(bytes)]]))).kind, "scene");
  }
});

test("a frame that takes too long ends with a message, at the last good frame", () => {
  const world = made(SHEET, ["system.0.substeps=100000"]);
  const before = world.hash();
  const found = failure(() => world.step(50));
  assert.equal(found.kind, "limit");
  assert.equal(world.hash(), before);
  world.free();
});

test("a scene that blows up says so and stays at its last good frame", () => {
  const world = made(SHEET, ["system.0.integrator=forward_euler", "system.0.substeps=1", "sheet.s.links.structural.modulus=1e6"]);
  const found = failure(() => {
    for (let i = 0; i < 200; i++) world.step(60_000);
  });
  assert.equal(found.kind, "step");
  assert.match(found.message, /stable step|no stable step/);
  world.free();
});

test("values change in a running world, or start it anew", () => {
  const world = made(SHEET);
  for (let i = 0; i < 5; i++) world.step(60_000);
  const state = world.hash();
  assert.equal(world.set("world.gravity", "[0, 0, -1]"), true);
  assert.equal(world.index(), 5);
  assert.equal(world.hash(), state);
  assert.deepEqual((JSON.parse(world.info()) as SceneInfo).scene.world, { gravity: [0, 0, -1], memory_limit: 8, coupling: null });
  assert.equal(world.set("sheet.s.resolution", "[9, 9]"), false);
  assert.equal(world.index(), 0);
  assert.equal(failure(() => world.set("sheet.s.resolution", "[1, 9]")).kind, "scene");
  assert.equal(failure(() => world.set("nothing.here", "1")).kind, "scene");
  world.free();
});

test("a hand pulls and lets go, and going back forgets it", () => {
  const world = made(SHEET);
  const height = () => Number(world.columns(["position"]).s.position.data[3 * 63 + 2]);
  const start = world.save();
  for (let i = 0; i < 12; i++) world.step(60_000);
  const [fallen, free] = [height(), world.hash()];
  world.restore(start);
  world.grab("s", 63, [0.5, 0.5, 1.0], undefined);
  for (let i = 0; i < 12; i++) world.step(60_000);
  assert.ok(height() > fallen + 0.1, `${height()} against ${fallen}`);
  world.release();
  world.restore(start);
  for (let i = 0; i < 12; i++) world.step(60_000);
  assert.equal(world.hash(), free);
  assert.equal(failure(() => world.grab("s", 64, [0, 0, 0], undefined)).kind, "scene");
  assert.equal(failure(() => world.grab("nobody", 0, [0, 0, 0], undefined)).kind, "scene");
  world.free();
});

test("a gas is stirred around a point", () => {
  const world = made(GAS);
  world.stir("g", [0, 0, 0], [1, 0, 0.5], 0.1, 2.0);
  const columns = world.columns(["velocity_x", "density"]).g;
  const [x, density] = [columns.velocity_x, columns.density];
  assert.deepEqual(x.points, [33, 32]);
  // Around the middle of the box; one row of faces left of it, one right.
  const peak = Math.max(...x.data);
  assert.ok(peak > 0.9 && peak <= 1.0, String(peak));
  const at = x.data.indexOf(peak) % 33;
  assert.ok(Math.abs(at - 16) <= 1, String(at));
  // The integral of a Gaussian of radius r is pi r², here of 2 kg/m³.
  const mass = density.data.reduce((sum: number, d: number) => sum + d, 0) / 32 ** 2;
  assert.ok(Math.abs(mass - 2 * Math.PI * 0.01) < 1e-4, String(mass));
  world.step(60_000);
  assert.equal(failure(() => world.stir("g", [0, 0, 0], [1, 0, 0], 0, 0)).kind, "scene");
  assert.equal(failure(() => world.stir("h", [0, 0, 0], [1, 0, 0], 1, 0)).kind, "scene");
  world.free();
});

test("kept frames stay within their memory", () => {
  const kept = new Kept(1000);
  for (let i = 0; i <= 500; i++) kept.add(i, () => new Uint8Array(10).fill(i % 256));
  const frames = kept.frames();
  assert.equal(frames[0], 0);
  assert.ok(frames.length > 40 && frames.length <= 100, String(frames.length));
  assert.equal(kept.at(300)[0], frames.filter((f) => f <= 300).at(-1)! % 256);
  kept.cut(200);
  assert.ok(kept.frames().every((f) => f < 200));
  kept.cut(0);
  assert.deepEqual(kept.frames(), [0]);
});

test("frames stay within their memory, those of both ways", () => {
  const frame = (index: number) => ({
    index,
    time: index,
    columns: { a: { x: { data: new Float32Array(25), width: 1, points: [], unit: "1" } } },
    ledgers: [],
    report: null,
    ms: 0,
    kept: [],
    sight: null,
  });
  const way = new Way(10_000);
  for (let i = 0; i <= 500; i++) {
    way.take(frame(i));
    assert.ok(way.memory <= 10_000, `${way.memory} bytes after frame ${i}`);
    assert.ok(way.frame(0) && way.frame(i));
  }
  // A hundred fit; the last ones are all there.
  assert.ok(way.kept.length >= 75 && way.kept.length <= 100, `${way.kept.length}`);
  for (let i = 470; i <= 500; i++) assert.ok(way.frame(i), `frame ${i}`);
  const other = way.copy(2_000);
  assert.ok(other.memory <= 2_000 && other.kept.length >= 15, `${other.kept}`);
  assert.deepEqual([other.kept[0], other.kept.at(-1), other.last], [0, 500, 500]);
  assert.equal(
    way.near(3)!.index,
    way.kept.reduce((a, b) => (Math.abs(b - 3) < Math.abs(a - 3) ? b : a)),
  );
  // Going another way forgets what came after, here and nowhere else.
  const { length } = other.kept;
  way.take(frame(480));
  assert.deepEqual([way.last, way.kept.at(-1), other.kept.length], [480, 480, length]);
  // One frame alone may be larger than the bound.
  const large = new Way(50);
  for (let i = 0; i < 4; i++) large.take(frame(i));
  assert.deepEqual(large.kept, [0, 3]);
});

test("of small states no more are kept than can be listed with every frame", () => {
  const kept = new Kept(2 ** 30);
  for (let i = 0; i <= 300_000; i++) kept.add(i, () => new Uint8Array([i % 251]));
  const frames = kept.frames();
  assert.ok(frames.length > 4000 && frames.length <= 8192, String(frames.length));
  assert.equal(kept.at(299_999)[0], frames.at(-1)! % 251);
  assert.equal(kept.at(63)[0], frames.filter((f) => f <= 63).at(-1)! % 251);
});

test("memory stays flat over frames, worlds and values", () => {
  const round = () => {
    const world = made(SHEET);
    for (let i = 0; i < 400; i++) {
      world.step(60_000);
      world.columns(["position", "velocity"]);
      world.save();
    }
    for (let i = 0; i < 50; i++) world.set("world.gravity", `[0, 0, ${-i}]`);
    world.free();
  };
  round();
  const before = memory.buffer.byteLength;
  for (let i = 0; i < 5; i++) round();
  assert.equal(memory.buffer.byteLength, before);
});

test("a failure of a hostile scene is short enough to be shown", () => {
  const found = readable(failure(() => made(`${BALL}${'[[force]]\nkind = "dra"\n'.repeat(5000)}`)));
  assert.equal(found.issues.length, 100);
  assert.match(found.message, /^line 6: force\[0\]\.kind[\s\S]*… and more$/);
  assert.ok(found.message.length < 7000);
  const long = readable(failure(() => made(`${BALL}${"k".repeat(1e6)} = 1\n`)));
  assert.ok(long.message.length < 7000 && long.issues[0].message.length < 1000 && long.issues[0].path.length < 1000);
  const short = failure(() => made("version = 1\nx = = 2\n"));
  assert.deepEqual(readable(short), { ...short, path: short.path });
});

test("a key that is there twice is named, with the first place", () => {
  const said = (text: string) => {
    const found = readable(
      failure(() => made(text)),
      text,
    );
    assert.equal(found.message, `line ${found.line}: ${found.issues[0].message}`);
    return found.issues[0].message;
  };
  assert.match(said("version = 1\n[time]\nfps = 24\n\nfps = 30\n"), /duplicate key: "fps", first in line 3$/);
  assert.match(said("version = 1\n[time]\nfps = 24\n[time]\nframes = 2\n"), /duplicate key: the table "time", first in line 2$/);
  assert.match(said('version = 1\n[[sheet]]\nname = "a"\n[sheet]\n'), /the table "sheet", first in line 2$/);
  assert.match(said("version = 1\ntime.fps = 2\n[time]\nframes = 3\n"), /the table "time"$/);
  assert.match(said('version = 1\nx = { a = "b = 1, b = 2", c = 1, c = 2 }\n'), /"c"$/);
  assert.match(said('version = 1\n"a b" = 1\n"a b" = 2\n'), /"a b", first in line 2$/);
});

test("of the files that were brought only those count that a scene names", () => {
  const [mesh, other] = [new Uint8Array([1]), new Uint8Array([2])];
  assert.deepEqual(asked(["meshes/a.obj", "b.obj", "__proto__"], { "a.obj": mesh, "c.obj": other }), new Map([["meshes/a.obj", mesh]]));
  assert.deepEqual(asked(["x/a.obj"], { "a.obj": other, "x/a.obj": mesh }), new Map([["x/a.obj", mesh]]));
});

test("what the panel says is in words for people, of every word of scenes", () => {
  const { $defs } = JSON.parse(engine.schema()) as { $defs: Record<string, any> };
  const tables = Object.values($defs).flatMap((d) => [d, ...(d.oneOf ?? []), ...(d.anyOf ?? [])]);
  const all: [string, string][] = tables.flatMap((t) => Object.entries<any>(t.properties ?? {}).map(([k, p]) => [k, p.description ?? ""]));
  const said = all.map(([key, text]) => told("", key, text)).filter(Boolean);
  assert.ok(all.length > 400 && said.length > all.length / 2, `${said.length} of ${all.length}`);
  for (const text of [...said, ...Object.values(TEXTS)]) {
    assert.doesNotMatch(text, /[`"[\]{}=]|Default|Alternative|[a-z]_[a-z]/, text);
    assert.match(text, /^[A-Z0-9].*\.$/);
    assert.ok(text.length <= 141, text);
  }
  const keys = new Set(all.map(([key]) => key));
  assert.deepEqual(
    Object.keys(TEXTS).filter((name) => !keys.has(name.split(".").pop()!)),
    [],
  );
});

test("sliders run over what a quantity may be, not around its value", () => {
  const of = (value: number, key: string, unit = "1", limits = {}, whole = false, known?: [number, number]) => {
    const { low, high, log } = range(value, key, unit, limits, whole, known);
    assert.ok(low <= value && value <= high && low < high, `${value}: ${low} to ${high}`);
    assert.ok(!log || low > 0);
    return [low, high];
  };
  for (const friction of [0, 0.1, 0.4, 1.2]) assert.deepEqual(of(friction, "friction", "1", { minimum: 0 }), [0, 1.5]);
  for (const density of [0.05, 0.2, 2]) assert.deepEqual(of(density, "density", "kg/m²", { exclusiveMinimum: 0 }), [0.01, 10]);
  assert.deepEqual(of(0.3, "restitution", "1", { minimum: 0, maximum: 1 }), [0, 1]);
  assert.deepEqual(of(300, "view", "°", { minimum: 1, maximum: 360 }), [1, 360]);
  assert.deepEqual(of(10, "substeps", "", { minimum: 1, maximum: 1e7 }, true, ofSteps(12)), [1, 50]);
  assert.deepEqual(of(80, "substeps", "", { minimum: 1, maximum: 1e7 }, true, ofSteps(12)), [1, 100]);
  // Beyond what is usual, and of either sign.
  assert.deepEqual(of(1e30, "mass", "kg", { minimum: 0 }), [0, 2e30]);
  assert.deepEqual(of(-0.7, "height", "m"), [-2, 2]);
  assert.deepEqual(of(3e-5, "hinge", "N m", { minimum: 0 }), of(1e-3, "hinge", "N m", { minimum: 0 }));
  assert.deepEqual(of(0.5, "tolerance", "1", { exclusiveMinimum: 0, maximum: 0.6 }), [0, 0.6]);
});
