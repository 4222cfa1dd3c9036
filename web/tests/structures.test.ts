/** Families of links and what else one plays with, in a real browser. Needs `dist` (make web) and Chromium. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { after, before, describe, it } from "node:test";
import type { Page } from "playwright-core";
import type { SceneInfo } from "../src/engine/protocol";
import { changed, familiesOf, linked } from "../src/links";
import { type Lab, lab, ready, STILL, serious, WHOLE } from "./browser.ts";

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

describe("families of links", async () => {
  const PKG = resolve(import.meta.dirname, "../src/engine/pkg");
  const engine = await import(`${PKG}/single.js`);
  engine.initSync({ module: readFileSync(`${PKG}/single_bg.wasm`) });
  const info = (world: any): SceneInfo => ({ ...JSON.parse(world.info()), topology: world.topology() });
  const count = (toml: string, files = new Map<string, Uint8Array>()) => {
    const made = info(new engine.World(`version = 1\n${toml}`, [], files));
    const families = familiesOf(made, made.objects[0])!;
    return [0, 1, 2].map((f) => families.filter((x) => x === f).length);
  };

  it("are told by what their links connect", () => {
    const links = "links = { structural = 5, shear = { modulus = 3, hardening = 1 }, bend = { modulus = 1, tension_only = true } }";
    // Other laws are kept in other lists, so that the order of links does not tell families.
    assert.deepEqual(count(`[[sheet]]\nname = "a"\nsize = [1, 1]\nresolution = [5, 4]\n${links}`), [
      4 * 4 + 5 * 3,
      2 * 4 * 3,
      3 * 4 + 5 * 2,
    ]);
    assert.deepEqual(
      count(`[[sheet]]\nname = "a"\nsize = [1, 1]\nresolution = [5, 4]\n${links.replace("links = {", 'links = { diagonals = "one",')}`)[1],
      4 * 3,
    );
    assert.deepEqual(count(`[[block]]\nname = "a"\nsize = [1, 1, 1]\nresolution = [4, 3, 2]\n${links}`), [
      3 * 6 + 4 * 2 * 2 + 12,
      2 * (3 * 2 * 2 + 4 * 2 + 3 * 3),
      2 * 6 + 4 * 1 * 2,
    ]);
    assert.deepEqual(
      count(`[[rope]]\nname = "a"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 6\nlinks = { structural = 5, bend = 1 }`),
      [6, 0, 5],
    );
    const mesh = new Map([["m.obj", new TextEncoder().encode("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n")]]);
    assert.deepEqual(count(`[[net]]\nname = "a"\nmesh = { path = "m.obj" }`, mesh), [5, 0, 1]);
  });

  it("are turned off without a change of state, and come back as they were", () => {
    const toml = (clamp: string) =>
      `version = 1\n[[system]]\nintegrator = "verlet"\nsubsteps = 60\n${clamp}\n[[sheet]]\nname = "a"\nsize = [1, 1]\nresolution = [6, 6]\nrotate = [90, 0, 0]\npin = ["edge x-"]\nlinks = { structural = 60, shear = { modulus = 40, damping = 0.05 }, bend = 1 }\n`;
    for (const clamp of ["", "clamp = 1.05"]) {
      /** How much longer one diagonal of a cell is than the other, at most. */
      const sheared = (on: boolean) => {
        const world = new engine.World(toml(clamp), [], new Map());
        for (let i = 0; i < 4; i++) world.step(1e5);
        const sheet = linked(info(world))[0];
        assert.equal(sheet.clamped, clamp !== "");
        const was = world.columns(["position"]).a.position.data.slice();
        if (!on) assert.equal(world.set(sheet.path, JSON.stringify(changed(sheet, "shear", null))), true);
        assert.deepEqual(world.columns(["position"]).a.position.data, was);
        for (let i = 0; i < 12; i++) world.step(1e5);
        const back = changed(linked(info(world))[0], "shear", sheet.families.shear!);
        assert.equal(world.set(sheet.path, JSON.stringify(back)), true);
        assert.deepEqual(linked(info(world))[0].families.shear, sheet.families.shear);
        const x = world.columns(["position"]).a.position.data;
        const far = (a: number, b: number) => Math.hypot(x[3 * a] - x[3 * b], x[3 * a + 1] - x[3 * b + 1], x[3 * a + 2] - x[3 * b + 2]);
        return Math.max(
          ...Array.from({ length: 25 }, (_, k) => k + Math.floor(k / 5)).map((i) => Math.abs(Math.log(far(i, i + 7) / far(i + 1, i + 6)))),
        );
      };
      const [held, free] = [sheared(true), sheared(false)];
      assert.ok(held > 0.001 && free > 3 * held, `${clamp}: cells are sheared by ${free} without shear links, by ${held} with them`);
    }
  });
});

/** Runs the world of the page some frames on, and reads its numbers. */
const numbers = async (page: Page, frames = 150) => {
  await page.evaluate(async (n) => {
    const { session } = (window as any).tumble;
    session.pause();
    await session.goto(session.latest + n);
  }, frames);
  return Object.fromEntries(await page.$$eval(".figure output", (all) => all.map((o) => [o.id, Number(o.dataset.value)]))) as Record<
    "way" | "pull" | "energy" | "strain",
    number
  >;
};
const held = (page: Page) => page.waitForFunction(() => (window as any).tumble.session.info.scene.anchor[0].stiffness > 0);
const free = (page: Page) => page.waitForFunction(() => (window as any).tumble.session.info.scene.anchor[0].stiffness === 0);

describe("structures", () => {
  it("give way where a family is missing, and are worked by keys", async () => {
    const { page, errors } = await own.open("structures", STILL);
    await ready(page);
    await page.focus("[data-deed=shear]");
    await page.keyboard.press("Enter");
    await held(page);
    assert.equal(await page.getAttribute("[data-deed=shear]", "aria-pressed"), "true");
    const whole = await numbers(page);
    // The legend lies around zero, and strains are on it.
    const legend = (await page.textContent(".legend")) ?? "";
    assert.match(legend, /strain−[\d.]+0[\d.]+/);
    const scale = await page.evaluate(() => (window as any).tumble.stage.legend);
    assert.ok(scale.low === -scale.high && scale.high > 0.01, JSON.stringify(scale));
    const frame = await page.evaluate(() => (window as any).tumble.session.latest);
    const shear = page.getByRole("checkbox", { name: "Shear", exact: true });
    await shear.focus();
    await page.keyboard.press("Space");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.sheet[0].links.shear.modulus === 0);
    const without = await numbers(page);
    assert.ok((await page.evaluate(() => (window as any).tumble.session.latest)) > frame, "the world began anew");
    // 0.49 m and 14 N with it; 0.58 m and 2 N without.
    assert.ok(without.way > whole.way + 0.05, `${without.way} m after ${whole.way} m`);
    assert.ok(without.pull < whole.pull / 4 && without.energy < whole.energy / 50, JSON.stringify({ whole, without }));
    // Let go, it stays sheared; with its shear links it goes home.
    await page.focus('[data-deed=""]');
    await page.keyboard.press("Space");
    await free(page);
    assert.ok((await numbers(page)).way > 0.4);
    await shear.focus();
    await page.keyboard.press("Space");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.sheet[0].links.shear.modulus === 300);
    assert.ok((await numbers(page, 240)).way < 0.01);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("bend in a curve with bend links, and crumple without", async () => {
    const { page, errors } = await own.open("structures", STILL);
    await ready(page);
    const bent: Record<string, number>[] = [];
    for (const on of [true, false]) {
      await page.selectOption("#structure", "block");
      await page.waitForFunction(() => (window as any).tumble.session.info.scene.block?.length);
      await page.selectOption("#structure", "sheet");
      await page.waitForFunction(() => (window as any).tumble.session.info.scene.sheet?.length);
      await page.getByRole("checkbox", { name: "Bend", exact: true }).setChecked(on);
      await page.waitForFunction((m) => (window as any).tumble.session.info.scene.sheet[0].links.bend.modulus > 0 === m, on);
      await page.click("[data-deed=bend]");
      await held(page);
      await numbers(page, 240);
      const x: number[] = await page.evaluate(() => [...(window as any).tumble.session.shown.columns.sheet.position.data]);
      // The sharpest turn along the middle row, and how high it stands.
      const [n, row] = [15, 5];
      const way = (i: number) => [0, 1, 2].map((k) => x[3 * (row * n + i + 1) + k] - x[3 * (row * n + i) + k]);
      const turns = Array.from({ length: n - 5 }, (_, i) => [way(i + 1), way(i + 2)]).map(([a, b]) =>
        Math.acos(Math.min(Math.max(a.reduce((s, v, k) => s + v * b[k], 0) / Math.hypot(...a) / Math.hypot(...b), -1), 1)),
      );
      bent.push({ sharpest: Math.max(...turns), highest: Math.max(...x.filter((_, i) => i % 3 === 2)) });
    }
    const [curved, crumpled] = bent;
    assert.ok(curved.sharpest < 1 && crumpled.sharpest > 1.5, JSON.stringify(bent));
    assert.ok(curved.highest > 0.2 && crumpled.highest < 0.5 * curved.highest, JSON.stringify(bent));
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("are all there, at their finest and coarsest, and open as scenes", async () => {
    const { page, errors } = await own.open("structures", STILL);
    await ready(page);
    for (const kind of ["rope", "block", "net", "sheet"]) {
      await page.selectOption("#structure", kind);
      await page.waitForFunction((k) => (window as any).tumble.session.info.scene[k]?.length, kind);
      for (const end of ["Home", "End"]) {
        const before = await page.evaluate(() => (window as any).tumble.session.info.hash);
        await page.locator(".slide input").first().press(end);
        await page.waitForFunction((h) => (window as any).tumble.session.info.hash !== h, before);
        const deeds = await page.$$eval("[data-deed]", (all) => all.map((b) => (b as HTMLElement).dataset.deed!).filter(Boolean));
        assert.ok(deeds.length > 1, kind);
        for (const deed of WHOLE ? deeds : deeds.slice(0, 2)) {
          await page.click(`[data-deed=${deed}]`);
          await held(page);
          const found = await numbers(page, WHOLE ? 30 : 10);
          assert.ok(
            found.way > 0.001 && Number.isFinite(found.energy + found.pull + found.strain),
            `${kind}, ${deed}: ${JSON.stringify(found)}`,
          );
        }
        assert.equal(await page.locator(".alert:visible").count(), 0);
      }
    }
    const way = await page.evaluate(() => document.getElementById("way")!.dataset.value);
    await page.click("text=Open as a scene");
    await page.waitForFunction(() => /^#\/s\//.test(location.hash) && document.getElementById("main")!.dataset.ready);
    assert.equal(await page.textContent("h1"), "A sheet in the hand");
    assert.ok(Number(way) > 0);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("scenes", () => {
  it("switch families of links while they run, and show which they draw", async () => {
    const { page, errors } = await own.open("scene/structures/others", STILL);
    await ready(page);
    await page.evaluate(() => (window as any).tumble.session.goto(5));
    const flag = page.getByRole("group", { name: "Links of flag" });
    await flag.getByLabel("shear").focus();
    await page.keyboard.press("Space");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.sheet[0].links.shear.modulus === 0);
    await page.locator(".panel .note", { hasText: "flag without shear links: continues from frame 5" }).waitFor();
    assert.equal(
      await page.evaluate(() => document.activeElement?.closest("[data-family]")?.getAttribute("data-family")),
      "sheet.0.links.shear",
    );
    // The others keep what they had, those that are written short, too.
    const links = () => page.evaluate(() => (window as any).tumble.session.info.scene.sheet[0].links);
    assert.equal((await links()).structural.modulus, 500);
    assert.equal((await links()).bend.modulus, 2);
    await page.getByLabel("Colour").selectOption("strain");
    await page.getByLabel("Links", { exact: true }).check();
    const drawn = (count: number) =>
      page.waitForFunction(
        (n) => (window as any).tumble.stage.things.find((t: any) => t.name === "flag").links.object.geometry.instanceCount === n,
        count,
      );
    const [structural, bend] = [24 * 19 + 25 * 18, 23 * 19 + 25 * 17];
    await drawn(structural + bend);
    await page.getByRole("group", { name: "Families of links shown" }).getByLabel("bend").uncheck();
    await drawn(structural);
    assert.match((await page.textContent(".legend")) ?? "", /strain/);
    await flag.getByLabel("shear").check();
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.sheet[0].links.shear.modulus === 100);
    await drawn(structural + 2 * 24 * 18);
    // Made anew from its changes, the world has the last of them.
    const last = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.set("sheet.0.links.shear.modulus", 30);
      await session.set("sheet.0.links", { structural: 500, shear: 70, bend: 2 });
      await session.load(session.toml, [...session.overrides]);
      return session.info.scene.sheet[0].links.shear;
    });
    assert.equal(last, 70);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("of particles have their most telling values first", async () => {
    const { page, errors } = await own.open("scene/particles/fountain", STILL);
    await ready(page);
    await page.waitForSelector(".play");
    assert.deepEqual(await page.$$eval(".group > summary", (all) => all.slice(0, 1).map((s) => s.textContent)), ["Play with"]);
    const rate = page.locator('.play [data-path="emitter.0.rate"]');
    assert.equal(await page.locator('[data-path="emitter.0.rate"]').count(), 1);
    await page.evaluate(() => (window as any).tumble.session.goto(6));
    await rate.locator("input[type=number]").fill("500");
    await rate.locator("input[type=number]").press("Enter");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.emitter[0].rate === 500);
    assert.equal(await page.evaluate(() => (window as any).tumble.session.latest), 6);
    await page.getByRole("navigation", { name: "Similar scenes" }).getByText("flock").click();
    await page.waitForSelector('.play [data-path="force.0.cohesion"]');
    // How a galaxy starts is seen only from its start.
    await page.evaluate(() => delete document.getElementById("main")!.dataset.ready);
    await page.getByRole("navigation", { name: "Similar scenes" }).getByText("galaxy").click();
    await ready(page);
    const stars = page.locator('.play [data-path="galaxy.0.stars"] input[type=number]');
    await stars.fill("500");
    await stars.press("Enter");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.galaxy[0].stars === 500);
    const start = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(2);
      return [...(session.frame(0).columns.galaxy.velocity?.data ?? session.frame(0).columns.galaxy.position.data)].slice(0, 30);
    });
    const toomre = page.locator('.play [data-path="galaxy.0.thickness"] input[type=number]');
    await toomre.fill("0.5");
    await toomre.press("Enter");
    await page.waitForFunction(() => (window as any).tumble.session.latest === 0);
    assert.notDeepEqual(
      await page.evaluate(() => [...(window as any).tumble.session.shown.columns.galaxy.position.data].slice(0, 30)),
      start,
    );
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("keep the rest of a table that their text leaves out", async () => {
    const { page, errors } = await own.open("scene/structures/rope", STILL);
    await ready(page);
    await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.load('version = 1\n[[sheet]]\nname = "s"\nsize = [1, 1]\nresolution = [4, 4]\npin = ["edge x-"]\n');
    });
    await page.getByLabel("All keys, with defaults").check();
    const shear = page.locator('[data-path="sheet.0.links.shear.modulus"] input[type=number]');
    await shear.fill("90");
    await shear.press("Enter");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.sheet[0].links.shear.modulus === 90);
    assert.equal(await page.evaluate(() => (window as any).tumble.session.info.scene.sheet[0].links.structural?.modulus), 500);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("everyone", () => {
  const PAGES = ["structures", "scene/structures/others", "scene/particles/flock"];
  for (const colorScheme of ["light", "dark"] as const) {
    it(`finds nothing serious by axe, ${colorScheme}`, async () => {
      for (const path of PAGES) {
        const { page, errors } = await own.open(path, { ...STILL, colorScheme, bypassCSP: true });
        await ready(page);
        if (path === "structures") {
          await page.click("[data-deed=twist]");
          await held(page);
          await numbers(page, 10);
        }
        const found = await serious(page);
        assert.deepEqual([path, found, errors], [path, [], []]);
        await page.context().close();
      }
    });
  }

  it("fits a phone, and is worked by touch", async () => {
    for (const path of PAGES) {
      const { page, errors } = await own.open(path, { ...STILL, viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
      await ready(page);
      const wide = await page.evaluate(() => [
        document.documentElement.scrollWidth,
        document.getElementById("nav")!.scrollWidth - document.getElementById("nav")!.clientWidth,
      ]);
      assert.deepEqual([path, wide], [path, [390, 0]]);
      if (path === "structures") {
        await page.tap("[data-deed=stretch]");
        await held(page);
        assert.ok((await numbers(page, 60)).way > 0.01);
      }
      assert.deepEqual(errors, []);
      await page.context().close();
    }
  });
});

describe("theory", () => {
  it("is cited by tags that stand in docs", () => {
    const cited = [...readFileSync("src/pages/structures.ts", "utf8").matchAll(/"([a-z]+)\.(\d+)"/g)].map((m) => [m[1], m[2]]);
    assert.ok(cited.length >= 5);
    assert.deepEqual(
      cited.filter(([page, k]) => !readFileSync(`../docs/theory/${page}.md`, "utf8").includes(`(${page}.${k})`)),
      [],
    );
  });
});
