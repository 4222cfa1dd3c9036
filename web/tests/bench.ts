/** Seconds that frames of scenes take in Chromium, compute only: { name: scene } on stdin, { name: seconds } on stdout. */
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { resolve } from "node:path";
import { chromium } from "playwright-core";
import { CHROMIUM } from "./browser.ts";

const PKG = resolve(import.meta.dirname, "../src/engine/pkg");
const repeats = Number(process.argv[2] ?? 7);
const scenes = JSON.parse(readFileSync(0, "utf8")) as Record<string, string>;

const types: Record<string, string> = { js: "text/javascript", wasm: "application/wasm", html: "text/html" };
const server = createServer((request, response) => {
  const name = (request.url ?? "/").slice(1) || "index.html";
  const body = name === "index.html" ? "<!doctype html>" : /^single(_bg)?\.\w+$/.test(name) ? readFileSync(`${PKG}/${name}`) : null;
  response.writeHead(body === null ? 404 : 200, { "Content-Type": types[name.split(".").pop()!] ?? "text/plain" });
  response.end(body ?? "");
});
await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
const { port } = server.address() as { port: number };
const browser = await chromium.launch({ executablePath: CHROMIUM, headless: true, args: ["--no-sandbox"] });
const seconds: Record<string, number> = {};
for (const [name, scene] of Object.entries(scenes)) {
  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${port}/`);
  seconds[name] = await page.evaluate(
    async ([text, count]) => {
      const path = "/single.js";
      const engine = await import(path);
      await engine.default();
      const world = new engine.World(text, [], new Map());
      world.step(60_000);
      world.step(60_000);
      // The first frames run in code that is not yet optimised.
      const warm = performance.now();
      while (performance.now() - warm < 1500) world.step(60_000);
      let best = Infinity;
      for (let i = 0; i < (count as number); i++) {
        const start = performance.now();
        world.step(60_000);
        world.step(60_000);
        best = Math.min(best, (performance.now() - start) / 2000);
      }
      return best;
    },
    [scene, repeats] as const,
  );
  await page.close();
}
await browser.close();
server.close();
console.log(JSON.stringify(seconds));
