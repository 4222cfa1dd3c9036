/**
 * States of scenes in WebAssembly, by hash, without a browser: what python/tests/matrix.py holds against the native engine.
 *
 * Reads a JSON list of { name, text, overrides, files: { path: file }, frames, checkpoint?: file } and writes a line of JSON for each:
 * { name, hashes, restored }, the hashes of all frames, then those from a native checkpoint on.
 */
import { readFileSync } from "node:fs";

const PKG = new URL("../src/engine/pkg/", import.meta.url);
const modules = {};

async function engine(precision) {
  if (!modules[precision]) {
    const made = await import(new URL(`${precision}.js`, PKG).href);
    made.initSync({ module: readFileSync(new URL(`${precision}_bg.wasm`, PKG)) });
    modules[precision] = made;
  }
  return modules[precision];
}

/** The hashes from where a world stands up to a frame; a failure is the last of them. */
function run(world, frames) {
  const hashes = [world.hash()];
  while (world.index() < frames) {
    try {
      world.step(3_600_000);
    } catch (failure) {
      const { kind, message } = JSON.parse(String(failure.message ?? failure));
      if (kind !== "step") throw failure;
      hashes.push(`broke: ${message}; ${world.hash()}`);
      break;
    }
    hashes.push(world.hash());
  }
  return hashes;
}

for (const { name, text, overrides, files, frames, checkpoint } of JSON.parse(readFileSync(0, "utf8"))) {
  const held = new Map(Object.entries(files).map(([path, file]) => [path, new Uint8Array(readFileSync(file))]));
  const module = await engine((await engine("single")).precision(text, overrides));
  const world = new module.World(text, overrides, held);
  const hashes = run(world, frames);
  let restored = [];
  if (checkpoint) {
    world.restore(new Uint8Array(readFileSync(checkpoint)));
    restored = run(world, frames);
  }
  world.free();
  console.log(JSON.stringify({ name, hashes, restored }));
}
