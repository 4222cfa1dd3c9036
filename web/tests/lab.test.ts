/** The laboratory in a real browser. Needs `dist` (make web) and Chromium. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, describe, it } from "node:test";
import { gzipSync } from "node:zlib";
import type { BrowserContext, Page } from "playwright-core";
import { frame, type Lab, lab, ready, SCENES, STILL, serious, shipped, tried, WHOLE } from "./browser.ts";

const ids = shipped();

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

/** Leaves the world of the page before for another, in the same worker. */
const visit = async (page: Page, path: string) => {
  await page.evaluate((to) => {
    delete document.getElementById("main")!.dataset.ready;
    location.hash = `#/${to}`;
  }, path);
  await ready(page);
};

describe("theory", () => {
  it("is cited by tags that stand in docs", () => {
    const cited = ["src/theory.ts", "src/pages/fluid.ts", "src/pages/integrators-systems.ts"].flatMap((f) =>
      [...readFileSync(f, "utf8").matchAll(/"([a-z]+)\.(\d+)"/g)].map((m) => [m[1], m[2]]),
    );
    const text = (page: string) => readFileSync(`../docs/theory/${page}.md`, "utf8");
    assert.ok(cited.length > 30);
    assert.deepEqual(
      cited.filter(([page, k]) => !text(page).includes(`(${page}.${k})`)),
      [],
    );
  });
});

/** Precisions of the engines that pages fetch. */
const engines = (context: BrowserContext) => {
  const used = new Set<string>();
  context.on("request", (r) => {
    const [, name] = /(single|double)_bg.*wasm$/.exec(r.url()) ?? [];
    if (name) used.add(name);
  });
  return used;
};

describe("gallery", () => {
  it("shows every scene that ships, with a picture of all of it", async () => {
    const { page, errors } = await own.open("", { reducedMotion: "reduce" });
    await page.waitForSelector(".tile");
    // Titles come without the texts of scenes, and without an engine.
    const first = await page.evaluate(() => performance.getEntriesByType("resource").map((r) => r.name.split("/").pop()!));
    const texts = ids.map((id) => `${id.split("/")[1]}-`);
    assert.ok(first.some((name) => /^gallery-.*js$/.test(name)));
    assert.deepEqual(
      first.filter((name) => name.endsWith(".wasm") || (name.endsWith(".js") && texts.some((text) => name.startsWith(text)))),
      [],
    );
    const tiles = await page.$$eval(".tile", (all) =>
      all.map((t) => ({
        id: t.querySelector(".tile-id")!.textContent,
        title: t.querySelector(".tile-title")!.textContent,
        picture: !!t.querySelector("img"),
      })),
    );
    assert.deepEqual(tiles.map((t) => t.id).sort(), ids);
    assert.deepEqual(
      tiles.filter((t) => !t.picture || !t.title).map((t) => t.id),
      [],
    );
    // Every folder of scenes has a title of its own, and its place.
    const rows = await page.$$eval(".rows section", (all) =>
      all.map((s) => ({ title: s.querySelector("h2")!.textContent!, row: s.querySelector(".tile-id")!.textContent!.split("/")[0] })),
    );
    assert.deepEqual(rows.map((r) => r.row).sort(), [...new Set(ids.map((id) => id.split("/")[0]))].sort());
    for (const { title, row } of rows) assert.match(title, /^[A-Z]/, `${row} has no title`);
    assert.deepEqual([rows[0].row, rows.at(-1)!.row], ["cloth", "failures"]);
    // Whole, by what is drawn at their edges.
    const seen = await page.evaluate(async () => {
      const out: { id: string; drawn: number; cut: boolean }[] = [];
      for (const tile of document.querySelectorAll(".tile")) {
        const { src } = tile.querySelector("img")!;
        const image = await createImageBitmap(await (await fetch(src)).blob());
        const [w, h] = [image.width, image.height];
        const context = new OffscreenCanvas(w, h).getContext("2d")!;
        context.drawImage(image, 0, 0);
        const { data } = context.getImageData(0, 0, w, h);
        let [drawn, top] = [0, 0];
        for (let y = 0; y < h; y++)
          for (let x = 2; x < w; x++) {
            const [p, q] = [4 * (w * y + x), 4 * (w * y + 1)];
            if (Math.abs(data[p] - data[q]) + Math.abs(data[p + 1] - data[q + 1]) + Math.abs(data[p + 2] - data[q + 2]) < 40) continue;
            drawn++;
            if (y < 3) top++;
          }
        out.push({ id: tile.querySelector(".tile-id")!.textContent!, drawn: drawn / (w * h), cut: top > 0 });
      }
      return out;
    });
    assert.deepEqual(
      seen.filter((s) => s.drawn < 2e-3).map((s) => s.id),
      [],
    );
    // Things that hang, fly or stand alone end below the upper edge.
    const alone = seen.filter((s) => /^(cloth|drape|springs|structures|integrators|failures)\//.test(s.id));
    assert.deepEqual(
      alone.filter((s) => s.cut).map((s) => s.id),
      [],
    );
    // A sheet that has exploded is no narrow band of blue.
    assert.ok(seen.find((s) => s.id === "failures/stiff-sheet")!.drawn > 0.05);
    await page.fill("input[type=search]", "bunny");
    const found = await page.$$eval(".tile-id", (all) => all.map((t) => t.textContent));
    assert.ok(found.length > 0 && found.length < ids.length && found.includes("drape/sheet-on-bunny"), `found ${found}`);
    // A word of a text alone.
    await page.fill("input[type=search]", "forward_euler");
    await page.waitForFunction(() => [...document.querySelectorAll(".tile-id")].some((t) => t.textContent === "failures/stiff-sheet"));
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("fetches the engine of the precision that a scene has, and no other", async () => {
    const context = await own.browser.newContext({ ...STILL });
    const page = await context.newPage();
    const used = engines(context);
    await page.goto(`${own.address}#/scene/contact/bounce`);
    await ready(page);
    // The panel asks the engine that is there.
    await page.waitForSelector(".panel .field", { state: "attached" });
    assert.deepEqual([...used], ["double"]);
    await context.close();
  });

  it("shows the first picture of a scene after some 3 MB, with nothing in the cache", async () => {
    const context = await own.browser.newContext({ ...STILL, viewport: { width: 1280, height: 800 } });
    const page = await context.newPage();
    const sizes: Promise<number>[] = [];
    const used = engines(context);
    context.on("response", (r) => {
      if (r.ok())
        sizes.push(
          r.body().then(
            (b) => gzipSync(b).length,
            () => 0,
          ),
        );
    });
    await page.goto(`${own.address}#/scene/drape/clamped-sheet`);
    await frame(page, 0);
    assert.deepEqual([...used], ["single"]);
    const bytes = (await Promise.all(sizes)).reduce((a, b) => a + b, 0);
    console.log(`# first picture after ${(bytes / 1e6).toFixed(2)} MB gzipped`);
    // With the engine, which is above 1 MB, 0.2 MB of them the shapes of rigid bodies; `make validate` has the one that ships, others are larger.
    assert.ok(bytes > 1e6 && bytes < (WHOLE ? 3.4e6 : 3.9e6), `${bytes} bytes`);
    await context.close();
  });
});

describe("pages", () => {
  it("that cannot be fetched say so in words of their own", async () => {
    const { page } = await own.open("theory", STILL);
    await page.waitForSelector(".contents");
    await page.route("**/assets/fluid-*", (route) => route.abort());
    await page.evaluate(() => void (location.hash = "#/fluid"));
    await page.waitForSelector("text=A part of the laboratory could not be fetched");
    await page.context().close();
  });

  it("that are left before they have come leave nothing behind", async () => {
    const { page, errors } = await own.open("scene/structures/rope");
    await ready(page);
    await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      const prototype = Object.getPrototypeOf(session);
      const { load, play } = prototype;
      (window as any).playing = [];
      prototype.load = function (...words: unknown[]) {
        return load.apply(this, words).then((info: unknown) => (((window as any).loaded = (window as any).loaded + 1 || 1), info));
      };
      prototype.play = function () {
        play.call(this);
        (window as any).playing.push(this);
      };
      // To the page of fluids, and away as soon as it is there.
      const seen = new MutationObserver(() => {
        if (!document.querySelector(".stirs")) return;
        seen.disconnect();
        location.hash = "#/theory";
      });
      seen.observe(document.body, { childList: true, subtree: true });
      location.hash = "#/fluid";
    });
    await page.waitForSelector(".contents");
    await page.waitForFunction(() => (window as any).loaded && (window as any).playing.length);
    const left = await page.evaluate(() => ({
      playing: (window as any).playing.some((s: any) => s.playing),
      ready: document.getElementById("main")!.dataset.ready,
      heads: [...document.querySelectorAll("h1")].map((e) => e.textContent),
    }));
    assert.deepEqual(left, { playing: false, ready: undefined, heads: ["Theory"] });
    await page.focus(".skip");
    await page.keyboard.press("Enter");
    assert.deepEqual(await page.evaluate(() => [document.activeElement!.id, location.hash]), ["main", "#/theory"]);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

/** Scenes that show nothing in their first frame, or are to fail, and when they do. */
const LATER: Record<string, number> = { "springs/rusty": 32, "particles/fireworks": 30, "failures/stiff-sheet": 8 };
/** Scenes that are there to fail. */
const FAILING = ["failures/stiff-sheet"];

describe("scenes", () => {
  it("all load, move, and are seen, without an error", async () => {
    const all = [...new Set([...tried(1), ...FAILING, ...Object.keys(LATER)])];
    const { page, errors } = await own.open(`scene/${all[0]}`, { ...STILL, viewport: { width: 640, height: 480 } });
    await ready(page);
    const failures: string[] = [];
    for (const id of all) {
      const start = Date.now();
      if (id !== all[0]) await visit(page, `scene/${id}`);
      const seen = await page.evaluate(async (end) => {
        const { session, stage } = (window as any).tumble;
        if (!session.info) return { error: document.querySelector(".alert")?.textContent ?? "nothing loaded" };
        const before = await session.hash();
        await session.goto(end).catch(() => {});
        const after = await session.hash();
        const image = await createImageBitmap(await stage.picture());
        const small = new OffscreenCanvas(160, 90);
        const context = small.getContext("2d")!;
        context.drawImage(image, 0, 0, 160, 90);
        const { data } = context.getImageData(0, 0, 160, 90);
        // Pixels that are not the background, whose colours run from top to bottom alone.
        let drawn = 0;
        for (let y = 0; y < 90; y++)
          for (let x = 1; x < 160; x++) {
            const [p, q] = [4 * (160 * y + x), 4 * 160 * y];
            if (Math.abs(data[p] - data[q]) + Math.abs(data[p + 1] - data[q + 1]) + Math.abs(data[p + 2] - data[q + 2]) > 8) drawn++;
          }
        return {
          moved: before !== after,
          index: session.shown.index,
          drawn,
          finite: Number.isFinite(session.ledgers[end]?.energy),
          alert: document.querySelector<HTMLElement>(".alert:not([hidden])")?.dataset.kind,
        };
      }, LATER[id] ?? 1);
      if (FAILING.includes(id)) {
        if (seen.alert !== "step") failures.push(`${id}: does not say that it failed`);
      } else if ("error" in seen) failures.push(`${id}: ${seen.error}`);
      else if (!seen.moved || seen.index !== (LATER[id] ?? 1) || seen.alert || !seen.finite || seen.drawn < 3)
        failures.push(`${id}: ${JSON.stringify(seen)}`);
      if (process.env.VERBOSE) console.log(`# ${id} ${Date.now() - start} ms ${JSON.stringify(seen)}`);
    }
    assert.deepEqual(failures, []);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("go sub-step by sub-step through a frame, and leave its bits alone", async () => {
    const { page, errors } = await own.open("scene/structures/rope", STILL);
    await ready(page);
    const { substeps, straight, dt } = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      for (let i = 0; i < 3; i++) await session.next();
      const straight = await session.hash();
      session.scrub(2);
      return { substeps: session.info.scene.system[0].substeps as number, straight, dt: session.info.dt as number };
    });
    assert.ok(substeps > 3);
    await page.focus(".stage");
    const times: number[] = [];
    for (let k = 1; k < substeps; k++) {
      await page.keyboard.press(";");
      await page.waitForFunction((n) => (window as any).tumble.session.shown.inside?.substeps === n, k);
      times.push(await page.evaluate(() => (window as any).tumble.session.shown.time));
    }
    assert.match((await page.textContent(".clock")) ?? "", new RegExp(`^2 \\+ ${substeps - 1} sub-steps`));
    const h = dt / substeps;
    times.forEach((t, k) => assert.ok(Math.abs(t - (2 * dt + (k + 1) * h)) < 1e-9, `${k}: ${t}`));
    // The last one makes the frame whole.
    await page.click("[aria-label='One sub-step forward']");
    await page.waitForFunction(() => (window as any).tumble.session.shown.index === 3);
    assert.equal(await page.evaluate(() => (window as any).tumble.session.hash()), straight);
    // Back from between two frames is to the one before.
    await page.focus(".stage");
    await page.keyboard.press(";");
    await page.waitForFunction(() => (window as any).tumble.session.shown.inside);
    await page.click("[aria-label='One frame back']");
    assert.deepEqual(
      await page.evaluate(() => [(window as any).tumble.session.shown.index, !!(window as any).tumble.session.shown.inside]),
      [3, false],
    );
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("play by the space bar, go back, and go another way", async () => {
    const { page, errors } = await own.open("scene/structures/rope", STILL);
    await ready(page);
    // Its own 24 frames a second need no word.
    assert.equal(await page.isHidden(".pace"), true);
    await page.focus(".stage");
    await page.keyboard.press(" ");
    await frame(page, 8);
    await page.keyboard.press(" ");
    assert.equal(await page.getAttribute(".transport .primary", "aria-label"), "Play");
    const result = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.reset();
      for (let i = 0; i < 6; i++) await session.next();
      await session.goto(10);
      const straight = await session.hash();
      session.scrub(5);
      const shown = session.shown.index;
      // The same value: the same way, bit by bit.
      const live = await session.set("force.0.rate", 1.0);
      const from = session.latest;
      await session.goto(10);
      const same = await session.hash();
      session.scrub(5);
      await session.set("force.0.rate", 3.0);
      await session.goto(10);
      return { straight, shown, live, from, same, other: await session.hash() };
    });
    assert.equal(result.shown, 5);
    assert.equal(result.from, 5);
    assert.equal(result.live, true);
    assert.equal(result.same, result.straight);
    assert.notEqual(result.other, result.straight);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("show all of their camera's picture, whatever its shape, and say that graphics are lost", async () => {
    const scene = {
      version: 1,
      // At the ends of a picture that is three times as high as it is wide.
      particles: [
        {
          name: "ends",
          position: [
            [0, 0, 2.6],
            [0, 0, -2.6],
            [0.85, 0, 0],
          ],
          radius: 0.05,
        },
      ],
      camera: { position: [0, -6, 0], target: [0, 0, 0], view_angle: 18, resolution: [300, 900] },
    };
    const { page, errors } = await own.open("", STILL);
    await page.setInputFiles("#file", { name: "ends.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(scene)) });
    await ready(page);
    for (const [width, height] of [
      [1280, 800],
      [320, 640],
    ]) {
      await page.setViewportSize({ width, height });
      // The stage follows the size of its element a frame later.
      await page.waitForFunction((most) => {
        const { canvas, renderer } = (window as any).tumble.stage;
        return canvas.clientWidth <= most && Math.abs(canvas.width - canvas.clientWidth * renderer.getPixelRatio()) < 1.5;
      }, width);
      const places: number[][] = await page.evaluate(() => {
        const { stage } = (window as any).tumble;
        return [
          [0, 0, 2.6],
          [0, 0, -2.6],
          [0.85, 0, 0],
        ].map((p) =>
          stage.camera.position
            .clone()
            .set(...p)
            .project(stage.camera)
            .toArray(),
        );
      });
      const most = Math.max(...places.flatMap(([x, y]) => [Math.abs(x), Math.abs(y)]));
      assert.ok(most > 0.8 && most < 1, `${width}: the farthest stands at ${most} of the half`);
    }
    const lose = (name: string) =>
      page.evaluate((n) => {
        const { canvas } = (window as any).tumble.stage;
        ((window as any).graphics ??= canvas.getContext("webgl2").getExtension("WEBGL_lose_context"))[n]();
      }, name);
    const picture = () =>
      page.evaluate(async () => {
        const bytes = new Uint8Array(await (await (window as any).tumble.stage.picture()).arrayBuffer());
        return bytes.reduce((hash, b) => (31 * hash + b) | 0, bytes.length);
      });
    const before = await picture();
    await page.evaluate(() => ((window as any).tumble.stage.things[0].body.object.visible = false));
    assert.notEqual(await picture(), before, "nothing is drawn");
    await page.evaluate(() => ((window as any).tumble.stage.things[0].body.object.visible = true));
    await lose("loseContext");
    await page.waitForSelector(".gone:not([hidden])");
    assert.match((await page.textContent(".gone"))!, /taken the graphics away/);
    await page.click("[aria-label='Save the picture (PNG)']");
    await page.waitForFunction(() => /no picture/.test(document.getElementById("say")?.textContent ?? ""));
    await lose("restoreContext");
    await page.waitForSelector(".gone", { state: "hidden" });
    assert.equal(await picture(), before);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("play as many frames a second as can be watched, and say how many", async () => {
    const { page, errors } = await own.open("scene/heat/finned_plate", STILL);
    await ready(page);
    assert.match((await page.textContent(".pace"))!, /24 frames a second; the scene has 0\.15: one second shows 160 s/);
    await page.selectOption(".transport select", "0.5");
    assert.match((await page.textContent(".pace"))!, /12 frames a second.*80 s/);
    const start = Date.now();
    await page.click(".transport .primary");
    // In its own time twenty seconds.
    await frame(page, 3);
    assert.ok(Date.now() - start < 10_000, `${Date.now() - start} ms`);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("have legends that tell what is there", async () => {
    const { page, errors } = await own.open("scene/gas/obstacle", STILL);
    await ready(page);
    const told = await page.evaluate(async () => {
      const { session, stage } = (window as any).tumble;
      Object.assign(stage.look, { field: "temperature", slice: 1 });
      await session.goto(2);
      const data: Float32Array = session.shown.columns.air.temperature.data;
      return { ...stage.legend, least: data.reduce((a, b) => Math.min(a, b)), most: data.reduce((a, b) => Math.max(a, b)) };
    });
    assert.equal(told.unit, "K");
    assert.deepEqual([told.low, told.high], [told.least, told.most]);
    assert.ok(told.most > 390 && told.most < 394, `the source holds 393 K, not ${told.most}`);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("are pulled by the pointer", async () => {
    const { page, errors } = await own.open("scene/springs/forever", STILL);
    await ready(page);
    const at = await page.evaluate(() => {
      const { stage, session } = (window as any).tumble;
      const x = session.shown.columns.spring.position.data;
      const p = stage
        .under({ clientX: 0, clientY: 0 })
        .clone()
        .set(x[3], x[4], x[5])
        .project((stage as any).camera);
      const box = document.querySelector(".stage canvas")!.getBoundingClientRect();
      return { x: box.left + (0.5 + 0.5 * p.x) * box.width, y: box.top + (0.5 - 0.5 * p.y) * box.height };
    });
    await page.mouse.move(at.x, at.y);
    await page.mouse.down();
    await page.mouse.move(at.x, at.y - 40, { steps: 3 });
    await page.mouse.move(at.x, at.y - 80, { steps: 3 });
    await frame(page, 4);
    // Alone it would stay on the axis for ever.
    await page.waitForFunction(() => Math.abs((window as any).tumble.session.shown.columns.spring.position.data[5]) > 0.05);
    await page.mouse.up();
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("text and values", () => {
  it("show an error at its line while the old scene goes on", async () => {
    const { page, errors } = await own.open("scene/springs/forever", STILL);
    await ready(page);
    await page.click("#t-text");
    await page.waitForSelector(".cm-content");
    const before = await page.evaluate(() => (window as any).tumble.session.info.hash);
    const text: string = await page.evaluate(() => (window as any).tumble.session.toml);
    const broken = text.replace("substeps = 20", "substeps = -20");
    // It goes on playing, too.
    await page.evaluate(() => {
      const { session } = (window as any).tumble;
      session.endless = true;
      session.play();
    });
    const line = broken.split("\n").findIndex((l) => l.includes("-20")) + 1;
    await page.locator(".cm-content").fill(broken);
    await page.click("text=Run");
    await page.waitForSelector(".issues .line");
    assert.equal(await page.textContent(".issues .line"), `Line ${line}`);
    assert.match((await page.textContent(".issues")) ?? "", /substeps/);
    assert.equal(await page.$$eval(".cm-lint-marker-error", (m) => m.length), 1);
    const now = await page.evaluate(() => {
      const { session } = (window as any).tumble;
      return { playing: session.playing, index: session.shown.index, hash: session.info.hash };
    });
    assert.deepEqual([now.playing, now.hash], [true, before]);
    await frame(page, now.index + 3);
    await page.evaluate(() => (window as any).tumble.session.pause());
    await page.locator(".cm-content").fill(text.replace("substeps = 20", "substeps = 40"));
    await page.click("text=Run");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.system[0].substeps === 40);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("make controls of the schema, with units and texts", async () => {
    const { page, errors } = await own.open("scene/structures/rope", STILL);
    await ready(page);
    const field = page.locator('[data-path="rope.0.density"]');
    await field.waitFor();
    assert.match((await field.textContent()) ?? "", /Density.*kg\/m.*Weight of a metre/s);
    await field.locator("input[type=number]").fill("0.4");
    await field.locator("input[type=number]").press("Enter");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.rope[0].density === 0.4);
    // A value refused by the schema is left unchanged, with the reason.
    await page.locator('[data-path="rope.0.density"] input[type=number]').fill("-1");
    await page.locator('[data-path="rope.0.density"] input[type=number]').press("Enter");
    await page.waitForSelector(".note.bad");
    assert.equal(await page.evaluate(() => (window as any).tumble.session.info.scene.rope[0].density), 0.4);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("name the method and the integrator that are in force, and which steps are stable", async () => {
    const { page, errors } = await own.open("scene/structures/rope", STILL);
    await ready(page);
    const method = page.locator('[data-path="system.0.method"] select');
    const integrator = page.locator('[data-path="system.0.integrator"] select');
    const becomes = (name: string) => page.waitForFunction((n) => (window as any).tumble.session.info.systems[0].integrator === n, name);
    assert.deepEqual([await method.inputValue(), await integrator.inputValue()], ["dynamics", "implicit_euler"]);
    const steps = page.locator('[data-path="system.0.substeps"]');
    await steps.filter({ hasText: "Stable at every step" }).waitFor();
    await method.focus();
    await method.selectOption("position_based");
    await becomes("position_based");
    await integrator.waitFor({ state: "detached" });
    assert.equal(await method.evaluate((e) => e === document.activeElement), true, "the choice lost the focus");
    await method.selectOption("dynamics");
    await becomes("implicit_euler");
    await integrator.selectOption("symplectic_euler");
    await becomes("symplectic_euler");
    await steps.filter({ hasText: /Stable from \d+ sub-steps on/ }).waitFor();
    const stable = Number(/from (\d+)/.exec((await steps.textContent())!)![1]);
    const most = Number(await steps.locator("input[type=range]").getAttribute("max"));
    const reach = most < 6 ? 10 ** most : most;
    assert.ok(stable > 10 && reach >= 4 * stable && reach <= 10 * stable, `${stable} are stable, ${reach} can be had`);
    // By the name of its integrator, too.
    await page.evaluate(() => {
      const { session } = (window as any).tumble;
      return session.load(session.toml.replace('integrator = "implicit_euler"', 'integrator = "position_based"'));
    });
    await page.waitForFunction(
      () => document.querySelector<HTMLSelectElement>('[data-path="system.0.method"] select')?.value === "position_based",
    );
    await integrator.waitFor({ state: "detached" });
    await method.selectOption("dynamics");
    await becomes("implicit_euler");
    await integrator.waitFor();
    // What belongs to other integrators is not there, with all keys neither.
    await page.click("text=All keys, with defaults");
    const groups = await page.$$eval("legend", (all) => all.map((l) => l.textContent));
    assert.ok(groups.includes("Solver") && !groups.includes("Adaptive") && !groups.includes("Position-based dynamics"), `${groups}`);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("stay text: markup in a title is shown, sizes are limited", async () => {
    const { page, errors } = await own.open("scene/springs/forever", STILL);
    await ready(page);
    const result = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      const text: string = session.toml;
      await session.load(text.replace(/title = .*/, 'title = "<img src=x onerror=window.hit=1><b>x</b>"'));
      const title = document.querySelector("h1")!;
      const huge = await session
        .load('version = 1\n[[block]]\nname = "b"\nsize = [1, 1, 1]\nresolution = [5000, 5000, 5000]\nlinks = { structural = 1 }\n')
        .then(
          () => "loaded",
          (e: any) => e.failure.message,
        );
      const deep = await session.load(`version = 1\nx = ${"[".repeat(20000)}`).then(
        () => "loaded",
        (e: any) => e.failure.message,
      );
      return {
        text: title.textContent,
        children: title.childElementCount,
        hit: (window as any).hit,
        huge,
        deep,
        alive: await session.hash(),
      };
    });
    assert.equal(result.text, "<img src=x onerror=window.hit=1><b>x</b>");
    assert.equal(result.children, 0);
    assert.equal(result.hit, undefined);
    assert.match(result.huge, /memory|GiB|large/i);
    assert.notEqual(result.deep, "loaded");
    assert.match(result.alive, /^[0-9a-f]{16}$/);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("files", () => {
  it("are opened: a mesh gets a sheet that falls on it, anything else is refused", async () => {
    const { page, errors } = await own.open("", STILL);
    await page.setInputFiles("#file", { name: "notes.txt", mimeType: "text/plain", buffer: Buffer.from("x") });
    await page.waitForFunction(() => /neither a scene/.test(document.getElementById("say")?.textContent ?? ""));
    await page.setInputFiles("#file", {
      name: "one.json",
      mimeType: "application/json",
      buffer: Buffer.from(JSON.stringify({ version: 1, title: "one mass", particles: [{ name: "p", position: [[0, 0, 1]] }] })),
    });
    await ready(page);
    assert.equal(await page.evaluate(() => (window as any).tumble.session.info.title), "one mass");
    await page.evaluate(() => {
      delete document.getElementById("main")!.dataset.ready;
      location.hash = "#/";
    });
    await page.waitForSelector("#file", { state: "attached" });
    await page.setInputFiles("#file", `${SCENES}/assets/bunny.ply`);
    await ready(page);
    const info = await page.evaluate(() => (window as any).tumble.session.info);
    assert.match(info.title, /falls on bunny\.ply/);
    assert.deepEqual(
      info.objects.map((o: any) => o.kind),
      ["sheet", "collider", "collider"],
    );
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("that a scene misses are dropped on its page, which then goes on", async () => {
    const { page, errors } = await own.open("", STILL);
    const text =
      'version = 1\ntitle = "waits"\n[[particles]]\nname = "p"\nposition = [[0, 0, 1]]\n[[collider]]\nname = "b"\nshape.mesh.path = "meshes/one.ply"\n';
    await page.setInputFiles("#file", { name: "waits.toml", mimeType: "application/toml", buffer: Buffer.from(text) });
    await page.waitForFunction(() => document.getElementById("main")!.dataset.ready === "failed");
    assert.match((await page.textContent(".alert")) ?? "", /no file "meshes\/one\.ply"; drop it on the page/);
    const drop = (name: string) =>
      page.evaluate(
        ([bytes, as]) => {
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File([new Uint8Array(bytes as number[])], as as string));
          dispatchEvent(new DragEvent("drop", { dataTransfer, cancelable: true }));
        },
        [[...readFileSync(`${SCENES}/assets/bunny.ply`)], name] as const,
      );
    await drop("one.ply");
    await page.waitForFunction(() => document.getElementById("main")!.dataset.ready === "true");
    assert.equal(await page.evaluate(() => (window as any).tumble.session.info.title), "waits");
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("tell of a failed run, and of changes that would have saved it", async () => {
    const { page, errors } = await own.open("scene/failures/stiff-sheet", STILL);
    await ready(page);
    await page.evaluate(() => (window as any).tumble.session.goto(20).catch(() => {}));
    await page.click("text=Search for a cure");
    await page.waitForSelector(".cures li");
    const cures = await page.$$eval(".cures li", (all) => all.map((l) => l.textContent ?? ""));
    assert.ok(
      cures.some((c) => /implicit|symplectic|step/.test(c) && /Apply and restart/.test(c)),
      cures.join("; "),
    );
    await page.locator(".cures button").first().click();
    // The run that failed had its frames, too: those of the new one are waited for.
    await page.waitForFunction(() => {
      const { session } = (window as any).tumble;
      return session.overrides.size > 0 && session.playing;
    });
    await frame(page, 4);
    assert.ok(
      await page.evaluate(
        () => (window as any).tumble.session.overrides.size > 0 && (document.querySelector(".alert") as HTMLElement).hidden,
      ),
    );
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("everyone", () => {
  const PAGES = ["", "scene/drape/sheet-on-ball", "fluid", "integrators", "theory", "theory/gas"];
  for (const colorScheme of ["light", "dark"] as const) {
    it(`finds nothing serious by axe, ${colorScheme}`, async () => {
      const found: string[] = [];
      // All else is the same in the dark.
      const only = colorScheme === "dark" ? ["color-contrast"] : undefined;
      for (const path of PAGES) {
        const { page } = await own.open(path, { ...STILL, colorScheme, bypassCSP: true });
        await page.waitForSelector("h1");
        if (/scene|fluid|integ/.test(path)) await ready(page);
        for (const tab of path.startsWith("scene") ? ["values", "text", "theory", "facts"] : [""]) {
          if (tab) await page.click(`#t-${tab}`);
          if (tab === "text") await page.waitForSelector(".cm-content");
          const issues = await serious(page, only);
          found.push(...issues.map((i) => `${path} ${tab}: ${i}`));
        }
        await page.context().close();
      }
      assert.deepEqual(found, []);
    });
  }

  it("fits a phone, and is worked by touch", async () => {
    for (const path of PAGES) {
      const { page, errors } = await own.open(path, { ...STILL, viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
      await page.waitForSelector("h1");
      if (/scene|fluid|integ/.test(path)) await ready(page);
      // The narrowest is a window of 320 with a bar that scrolls.
      for (const width of [390, 305]) {
        await page.setViewportSize({ width, height: 844 });
        // Plots follow the window a moment later.
        await page.waitForFunction((w) => document.documentElement.scrollWidth <= w, width, { timeout: 5000 }).catch(() => {});
        const wide = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(wide <= width, `${path} is ${wide} pixels wide, of ${width}`);
      }
      if (path.startsWith("scene")) {
        await page.tap(".transport .primary");
        await frame(page, 1);
      }
      assert.deepEqual(errors, []);
      await page.context().close();
    }
  });

  it("needs no more memory as time goes on: 2,000 frames", async () => {
    const { page, errors } = await own.open("scene/structures/rope", STILL);
    await ready(page);
    const heap = await page.context().newCDPSession(page);
    const sizes: number[] = [];
    for (const end of [500, 2000]) {
      await page.evaluate(async (to) => {
        const { session } = (window as any).tumble;
        await session.goto(to);
        session.trim(10);
      }, end);
      // Every frame is kept until then; what is counted is what is not let go.
      await heap.send("HeapProfiler.collectGarbage");
      sizes.push(await page.evaluate(() => (performance as any).memory.usedJSHeapSize as number));
    }
    // The books of 1,500 frames.
    assert.ok(sizes[1] - sizes[0] < 3e6, `${sizes}`);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});
