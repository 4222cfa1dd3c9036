/** The same bits in a tab as in the native engine: states of scenes, by hash, frame after frame. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { resolve } from "node:path";
import { test } from "node:test";
import { lab, ready, STILL, WHOLE } from "./browser.ts";

const ROOT = resolve(import.meta.dirname, "../..");
const PYTHON = resolve(ROOT, ".venv/bin/python");
const FRAMES = WHOLE ? 100 : 12;
/** Every method, explicit, implicit and adaptive steps, contact, both precisions; cheap ones. */
const NAMES = [
  "springs/stiffening",
  "springs/rusty",
  "structures/rope",
  "structures/rod",
  "integrators/kepler",
  "integrators/spiral",
  "contact/bounce",
  "contact/moving",
  "particles/fountain",
  "particles/vicsek",
  "particles/charged",
  "particles/lennard-jones",
  "heat/finned_plate",
  "gas/cavity",
  "gas/bad_solver",
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

test("states in a tab have the native engine's bits", { skip: !existsSync(PYTHON) && "no native engine here: make setup" }, async () => {
  const native = execFileSync(PYTHON, ["-c", NATIVE, String(FRAMES), ...NAMES], { encoding: "utf8", cwd: ROOT });
  const lines = new Map(
    native
      .trim()
      .split("\n")
      .map((line) => [line.split(" ")[0], line.split(" ").slice(1)]),
  );
  const own = await lab();
  try {
    const { page, errors } = await own.open("scene/springs/forever", STILL);
    await ready(page);
    const precisions = new Set<string>();
    for (const name of NAMES) {
      const text = readFileSync(`${ROOT}/python/tumble/scenes/${name}.toml`, "utf8");
      const { precision, hashes } = await page.evaluate(
        async ([toml, frames]) => {
          // The worker of the page, and a world beside that of the page.
          const { engine } = (window as any).tumble;
          const info = await engine.load(toml, { world: 7 });
          const hashes: string[] = [info.hash];
          for (let i = 0; i < frames; i++) hashes.push((await engine.step({ columns: [], hash: true }, 7)).hash);
          return { precision: info.scene.precision as string, hashes };
        },
        [text, FRAMES] as const,
      );
      precisions.add(precision);
      const wanted = lines.get(name)!;
      assert.equal(wanted.length, FRAMES + 1);
      assert.equal(hashes.length, FRAMES + 1);
      const first = hashes.findIndex((hash, i) => hash !== wanted[i]);
      assert.equal(first, -1, `${name}: frame ${first} differs`);
      assert.ok(new Set(hashes).size > 1, `${name} does not move`);
    }
    assert.deepEqual([...precisions].sort(), ["double", "single"]);
    assert.deepEqual(errors, []);
  } finally {
    await own.close();
  }
});
