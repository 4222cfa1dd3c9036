/** The same bits in the browser's engine as in the native one: states of scenes, by hash, frame after frame. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { resolve } from "node:path";
import { test } from "node:test";

const ROOT = resolve(import.meta.dirname, "../..");
const PYTHON = resolve(ROOT, ".venv/bin/python");
const PKG = resolve(ROOT, "web/src/engine/pkg");
const FRAMES = 100;
/** Every method, explicit, implicit and adaptive steps, contact, both precisions; cheap ones. */
const NAMES = [
  "springs/stiffening", "springs/rusty", "structures/rope", "structures/rod", "integrators/kepler", "integrators/spiral", "contact/bounce",
  "contact/moving", "particles/fountain", "particles/vicsek", "particles/charged", "particles/lennard-jones", "heat/finned_plate",
  "gas/cavity", "gas/bad_solver",
];

const NATIVE = `
import sys, tumble
from tumble.cli import find
for name in sys.argv[2:]:
    world = tumble.World(tumble.Scene.load(find.scene_file(name)), threads=2)
    hashes = [world.hash()]
    for _ in range(int(sys.argv[1])):
        world.step()
        hashes.append(world.hash())
    print(name, *hashes)
`;

async function engine(precision: string) {
  const module = await import(`${PKG}/${precision}.js`);
  module.initSync({ module: readFileSync(`${PKG}/${precision}_bg.wasm`) });
  return module;
}

test("states have the native engine's bits", { skip: !existsSync(PYTHON) && "no native engine here: make setup" }, async () => {
  const native = execFileSync(PYTHON, ["-c", NATIVE, String(FRAMES), ...NAMES], { encoding: "utf8", cwd: ROOT });
  const lines = new Map(native.trim().split("\n").map((line) => [line.split(" ")[0], line.split(" ").slice(1)]));
  const [single, double] = [await engine("single"), await engine("double")];
  const precisions = new Set<string>();
  for (const name of NAMES) {
    const text = readFileSync(`${ROOT}/python/tumble/scenes/${name}.toml`, "utf8");
    const precision: string = single.precision(text, []);
    precisions.add(precision);
    const world = new (precision === "double" ? double : single).World(text, [], new Map());
    const hashes = [world.hash()];
    for (let i = 0; i < FRAMES; i++) {
      world.step(60_000);
      hashes.push(world.hash());
    }
    world.free();
    const wanted = lines.get(name)!;
    assert.equal(wanted.length, FRAMES + 1);
    const first = hashes.findIndex((hash, i) => hash !== wanted[i]);
    assert.equal(first, -1, `${name}: frame ${first} differs`);
    assert.ok(new Set(hashes).size > 1, `${name} does not move`);
  }
  assert.deepEqual([...precisions].sort(), ["double", "single"]);
});
