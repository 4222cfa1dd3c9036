/** `tumble view`: a scene of one's own, with a mesh beside it, in a browser. */
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { test } from "node:test";
import { chromium } from "playwright-core";
import { fromFile, unpack } from "../src/share";
import { CHROMIUM, frame } from "./browser";

const ROOT = resolve(import.meta.dirname, "../..");
const PYTHON = resolve(ROOT, ".venv/bin/python");
const skip = !existsSync(PYTHON) && "no native engine here: make setup";

test("the page reads the links that the command line makes", { skip }, async () => {
  const code = `from tumble.cli.view import link, shared; print(link(shared('title = "Wärme – 20 m²"\\n' * 50, ["time.fps=30"], {"seed": 7})))`;
  const packed = execFileSync(PYTHON, ["-c", code], { encoding: "utf8", cwd: ROOT }).trim();
  const shared = await unpack(packed);
  assert.equal(shared.text, 'title = "Wärme – 20 m²"\n'.repeat(50));
  assert.deepEqual(shared.overrides, ["time.fps=30"]);
  assert.deepEqual(shared.scene, { seed: 7 });
});

test("a scene with a mesh of its own opens", { skip: skip || (!CHROMIUM && "no Chromium here") }, async () => {
  const folder = mkdtempSync(join(tmpdir(), "tumble-"));
  writeFileSync(join(folder, "my tent.obj"), "v 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1.5\nf 1 2 3\nf 2 4 3\n");
  const words = `version = 1\ntitle = "A tent"\n[[net]]\nname = "tent"\nmesh = { path = "my tent.obj" }\npin = ["vertex 0"]\n`;
  writeFileSync(join(folder, "scene.toml"), words);
  const run = ["-c", "from tumble.cli import main; main()", "view", join(folder, "scene.toml"), "--no-open"];
  const served = spawn(PYTHON, run, { cwd: ROOT, stdio: ["ignore", "pipe", "inherit"] });
  const browser = await chromium.launch({
    executablePath: CHROMIUM,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  try {
    const address = await new Promise<string>((found) =>
      served.stdout.once("data", (text: Buffer) => found(text.toString().split("\n")[0])),
    );
    const page = await browser.newPage();
    await page.goto(address);
    await frame(page, 0);
    assert.match(await page.title(), /A tent/);
    // The page uses the scene resolved by the command line.
    const version = /\/v\/([^/]+)\/\?view#\/s\//.exec(address)![1];
    await page.waitForFunction((v) => document.querySelector(".scene-id")!.textContent === `from a link of tumble ${v}`, version);
    // A mesh of one's own goes into a file.
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("text=Copy link")]);
    const { meshes } = await fromFile(readFileSync(await download.path()));
    assert.deepEqual(Buffer.from(meshes["my tent.obj"]), readFileSync(join(folder, "my tent.obj")));
    // Another version is not here: the server says so, and what to do.
    const answer = await page.goto(address.replace(`/v/${version}/`, "/v/0.0.1/"));
    assert.equal(answer!.status(), 404);
    assert.equal(await page.textContent("h1"), "tumble 0.0.1 is not available here");
    await page.click(`text=Open the scene with version ${version}`);
    await frame(page, 0);
    assert.match(await page.title(), /A tent/);
  } finally {
    await browser.close();
    served.kill("SIGINT");
  }
});
