/** Downloads, read by other programs. Numbers and surfaces need the native engine: make setup. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { after, before, describe, it } from "node:test";
import type { Page } from "playwright-core";
import { frame, type Lab, lab, ready, STILL } from "./browser.ts";

const ROOT = resolve(import.meta.dirname, "../..");
const PYTHON = resolve(ROOT, ".venv/bin/python");
const skip = !existsSync(PYTHON) && "no native engine here: make setup";
const folder = mkdtempSync(join(tmpdir(), "tumble-"));

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

const open = async (id: string) => {
  const { page, errors } = await own.open(`scene/${id}`, STILL);
  await ready(page);
  return { page, errors };
};

/** Presses a button and keeps what it gives. */
async function taken(page: Page, label: string): Promise<string> {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(`[aria-label="${label}"]`)]);
  const path = join(folder, download.suggestedFilename());
  await download.saveAs(path);
  return path;
}

/** Python's description of files. */
const python = (code: string, ...words: string[]) =>
  execFileSync(PYTHON, ["-c", code, ...words], {
    encoding: "utf8",
    cwd: join(ROOT, "python"),
    stdio: ["ignore", "pipe", "inherit"],
  }).trim();

describe("downloads", () => {
  it("are pictures, as large as the one on the page", async () => {
    const { page, errors } = await open("structures/rope");
    const path = await taken(page, "Save the picture (PNG)");
    assert.match(path, /rope-0\.png$/);
    const seen = await page.evaluate(
      async (bytes) => {
        const image = await createImageBitmap(new Blob([Uint8Array.from(bytes)]));
        const context = new OffscreenCanvas(image.width, image.height).getContext("2d")!;
        context.drawImage(image, 0, 0);
        const { data } = context.getImageData(0, 0, image.width, image.height);
        const canvas = document.querySelector("canvas")!;
        let least = 255;
        for (let i = 0; i < data.length; i += 4) least = Math.min(least, data[i] + data[i + 1] + data[i + 2]);
        return { size: [image.width, image.height], canvas: [canvas.width, canvas.height], corner: [...data.slice(0, 4)], least };
      },
      [...readFileSync(path)],
    );
    assert.deepEqual([...readFileSync(path).subarray(0, 4)], [0x89, 0x50, 0x4e, 0x47]);
    assert.deepEqual(seen.size, seen.canvas);
    assert.ok(
      seen.corner.every((c) => c > 230),
      `the background is ${seen.corner}`,
    );
    assert.ok(seen.least < 500, "there is no rope in it");
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("are films that play", async () => {
    const { page, errors } = await open("structures/rope");
    await page.click('[aria-label="Record a film (WebM)"]');
    await frame(page, 24);
    const path = await taken(page, "Stop the film and save it");
    assert.match(path, /rope\.webm$/);
    const film = readFileSync(path);
    assert.deepEqual([...film.subarray(0, 4)], [0x1a, 0x45, 0xdf, 0xa3]);
    assert.ok(film.length > 4000, `${film.length} bytes`);
    const canvas = await page.evaluate(() => [document.querySelector("canvas")!.width, document.querySelector("canvas")!.height]);
    const player = await page.context().newPage();
    const seen = await player.evaluate(async (text) => {
      const video = document.createElement("video");
      video.muted = true;
      video.src = `data:video/webm;base64,${text}`;
      // Recorders do not know the length beforehand; players find it at the end.
      await new Promise((done, fail) => ((video.onloadeddata = done), (video.onerror = () => fail(new Error(video.error?.message)))));
      let seconds = 0;
      // The end lies behind the last frame, where a player need not have a picture.
      for (const to of [1e6, 0.5]) {
        video.currentTime = to < 1 ? to * seconds : to;
        await new Promise((done) => (video.onseeked = done));
        seconds ||= video.currentTime;
      }
      // Through its gaps the background is visible.
      const image = await createImageBitmap(video);
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d")!;
      context.fillStyle = "#f0f";
      context.fillRect(0, 0, image.width, image.height);
      context.drawImage(image, 0, 0);
      return { size: [image.width, image.height], seconds, corner: [...context.getImageData(2, 2, 1, 1).data] };
    }, film.toString("base64"));
    assert.deepEqual(seen.size, canvas);
    assert.ok(seen.seconds > 0.5 && seen.seconds < 600, `${seen.seconds} s`);
    assert.ok(
      seen.corner.every((c) => c > 225),
      `the background is ${seen.corner}`,
    );
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  for (const id of ["structures/rope", "gas/ink", "gas/ball_in_a_tank"]) {
    it(`are numbers, in the order and with the bits of Python's: ${id}`, { skip }, async () => {
      const { page, errors } = await open(id);
      await page.evaluate(() => (window as any).tumble.session.goto(2));
      const path = await taken(page, "Download the stored frames (NPZ)");
      const code = `
import sys, numpy as np, tumble
from tumble.cli import find
world = tumble.World(find.scene(sys.argv[1], None))
file = np.load(sys.argv[2])
times, seen = [], 0
for i in range(3):
    for name, columns in world.frame.items():
        for column, values in columns.items():
            got = file[f"{name}/{column}/{i:06}"]
            assert got.shape == values.shape and got.dtype == values.dtype, (name, column, got.shape, values.shape, got.dtype)
            assert np.array_equal(got, values), (name, column, i)
            seen += 1
    times.append(world.time)
    world.step()
assert np.array_equal(file["time"], times)
assert len(file.files) == seen + 1, file.files
print(seen, max(file[name].ndim for name in file.files))
`;
      const [arrays, axes] = python(code, id, path).split(" ").map(Number);
      assert.ok(arrays >= 3, `${arrays} arrays`);
      assert.equal(axes, { "structures/rope": 2, "gas/ink": 3, "gas/ball_in_a_tank": 4 }[id]);
      assert.deepEqual(errors, []);
      await page.context().close();
    });
  }

  it("are surfaces, which are meshes of scenes again", { skip }, async () => {
    const { page, errors } = await open("drape/clamped-sheet");
    await page.evaluate(() => (window as any).tumble.session.goto(3));
    const path = await taken(page, "Save the surfaces (GLB)");
    assert.match(path, /clamped-sheet-3\.glb$/);
    const here = await page.evaluate(() => {
      const { session, stage } = (window as any).tumble;
      const x: number[] = [...session.shown.columns[stage.surfaces[0].name].position.data];
      const span = [0, 1, 2].map((d) => Math.max(...x.filter((_, i) => i % 3 === d)) - Math.min(...x.filter((_, i) => i % 3 === d)));
      return {
        triangles: stage.surfaces.reduce((sum: number, s: any) => sum + s.mesh.geometry.index.count / 3, 0),
        vertices: x.length / 3,
        span,
      };
    });
    const code = `
import json, sys, tumble
world = tumble.World({"version": 1, "net": [{"name": "n", "mesh": {"path": sys.argv[1]}}]})
x = world.columns("position")["n"]["position"]
print(json.dumps([len(world.topology["n"]["triangles"]), len(x), (x.max(axis=0) - x.min(axis=0)).tolist()]))
`;
    // In the file y is up, and it is read so.
    const [triangles, vertices, [x, y, z]] = JSON.parse(python(code, path)) as [number, number, number[]];
    assert.deepEqual([triangles, vertices], [here.triangles, here.vertices]);
    assert.ok(
      [x, y, z].every((s, d) => Math.abs(s - here.span[d]) < 1e-5),
      `${[x, y, z]} instead of ${here.span}`,
    );
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("are refused in words where a scene has no surface", async () => {
    const { page, errors } = await open("structures/rope");
    await page.click('[aria-label="Save the surfaces (GLB)"]');
    await page.waitForFunction(() => /no surface/.test(document.getElementById("say")?.textContent ?? ""));
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});
