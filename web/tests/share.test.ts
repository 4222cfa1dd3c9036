/** Scenes that are shared: links under /v/VERSION/, files, and what is wrong or hostile. */
import assert from "node:assert/strict";
import { existsSync, readdirSync, readFileSync, statSync } from "node:fs";
import { createServer, type Server } from "node:http";
import type { AddressInfo } from "node:net";
import { join, resolve } from "node:path";
import { after, before, describe, it } from "node:test";
import { gunzipSync, gzipSync } from "node:zlib";
import type { Page } from "playwright-core";
import type { SceneInfo } from "../src/engine/protocol";
import { fromFile, pack, type Shared, toFile, unpack } from "../src/share";
import { alike, meshesOf, written } from "../src/values";
import { type Lab, lab, tried, WHOLE } from "./browser.ts";

const STILL = { reducedMotion: "reduce" } as const;
const VERSION = /^version = "([^"]+)"/m.exec(readFileSync("../Cargo.toml", "utf8"))![1];
const DIST = process.env.DIST ?? "dist";
const SCENES = resolve("../python/tumble/scenes");

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

const ready = (page: Page) => page.waitForFunction(() => document.getElementById("main")!.dataset.ready);
const told = (page: Page, what: RegExp) =>
  page.waitForFunction(
    ([source, flags]) => new RegExp(source, flags).test(document.getElementById("say")?.textContent ?? ""),
    [what.source, what.flags],
  );

const scene = async (id: string) => {
  const { page, errors } = await own.open(`scene/${id}`, STILL);
  await ready(page);
  return { page, errors };
};

const copied = async (page: Page) => {
  await page.evaluate(() => delete document.getElementById("main")!.dataset.link);
  await page.click("text=Copy link");
  await page.waitForFunction(() => document.getElementById("main")!.dataset.link);
  return (await page.evaluate(() => document.getElementById("main")!.dataset.link))!;
};

/** A page in a context of its own, at an address as it stands. */
const visit = async (address: string) => {
  const made = await own.open("theory", STILL);
  await made.page.goto("about:blank");
  await made.page.goto(address);
  return made;
};

const dropped = async (name: string, buffer: Buffer) => {
  const made = await own.open("", STILL);
  await made.page.setInputFiles("#file", { name, mimeType: "application/octet-stream", buffer });
  return made;
};

describe("links", () => {
  it("to a frame that is far away can be stopped", async () => {
    const first = await scene("springs/forever");
    const { text, resolved } = await first.page.evaluate(() => ({
      text: (window as any).tumble.session.toml,
      resolved: (window as any).tumble.session.info.scene,
    }));
    const link = await pack({ version: VERSION, text, overrides: [], scene: resolved, changes: [], frame: 100_000, hash: "0".repeat(16) });
    const { page, errors } = await visit(`${own.address}v/${VERSION}/#/s/${link}`);
    await page.click("text=Stop here");
    await ready(page);
    const latest = () => page.evaluate(() => (window as any).tumble.session.latest as number);
    const stopped = await latest();
    await page.waitForTimeout(300);
    assert.equal(await latest(), stopped);
    assert.match((await page.textContent(".scene-id")) ?? "", /stopped before the shared frame/);
    await page.click("[aria-label='One frame forward']");
    await page.waitForFunction((n) => (window as any).tumble.session.latest === n + 1, stopped);
    assert.deepEqual([...first.errors, ...errors], []);
    await first.page.context().close();
    await page.context().close();
  });

  it("hold what was changed on the way: whoever opens one under its version sees the same bits", async () => {
    const first = await scene("structures/rope");
    const hashes = await first.page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.set("force.0.rate", 2.5);
      await session.goto(6);
      const six = await session.hash();
      await session.set("world.gravity", [0, 0, -3]);
      await session.goto(12);
      return { six, twelve: await session.hash() };
    });
    const link = await copied(first.page);
    assert.ok(link.startsWith(`${own.address}v/${VERSION}/#/s/`), link.slice(0, 80));
    const inside = await unpack(link.split("#/s/")[1]);
    assert.equal(inside.version, VERSION);
    assert.equal(inside.hash, hashes.twelve);
    assert.deepEqual(inside.changes, [
      { frame: 0, path: "force.0.rate", value: 2.5 },
      { frame: 6, path: "world.gravity", value: [0, 0, -3] },
    ]);
    assert.equal(inside.scene.seed, 0);
    const second = await visit(link);
    await ready(second.page);
    await second.page.waitForFunction(
      (h) => document.querySelector(".hash-line .hash")!.textContent === `${h} as in the link`,
      hashes.twelve,
    );
    assert.deepEqual(
      await second.page.evaluate(() => {
        const { session } = (window as any).tumble;
        return [session.shown.index, session.info.scene.force[0].rate, session.info.scene.world.gravity, session.before];
      }),
      [12, 2.5, [0, 0, -3], null],
    );
    assert.equal(await second.page.textContent(".scene-id"), `from a link of tumble ${VERSION}`);
    // A link of the link is the same link.
    assert.equal(await copied(second.page), link);
    // At an earlier frame it is a link to that one.
    await first.page.evaluate(() => (window as any).tumble.session.scrub(6));
    const earlier = await unpack((await copied(first.page)).split("#/s/")[1]);
    assert.deepEqual([earlier.frame, earlier.hash], [6, hashes.six]);
    assert.equal(await first.page.evaluate(() => (window as any).tumble.session.hash()), hashes.twelve);
    assert.deepEqual([...first.errors, ...second.errors], []);
    await first.page.context().close();
    await second.page.context().close();
  });

  it("keep the values that defaults had when they were made", async () => {
    const { page, errors } = await scene("structures/rope");
    const made = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      const text: string = session.toml;
      await session.load(text, [["world.gravity", [0, 0, -5]]]);
      await session.goto(3);
      return { text, hash: await session.hash(), scene: session.info.scene };
    });
    // As if the version that made it had had another gravity.
    const shared: Shared = { version: "0.0.1", text: made.text, overrides: [], scene: made.scene, changes: [], frame: 3, hash: made.hash };
    const other = await own.open(`s/${await pack(shared)}`, STILL);
    await ready(other.page);
    await other.page.waitForFunction((h) => document.querySelector(".hash-line .hash")!.textContent === `${h} as in the link`, made.hash);
    assert.equal(
      await other.page.textContent(".scene-id"),
      `from a link of tumble 0.0.1; opened with ${VERSION}: bits may differ; defaults have changed since, so all keys are written out`,
    );
    // A difference in bits is reported.
    const wrong = await own.open(`s/${await pack({ ...shared, hash: "0123456789abcdef" })}`, STILL);
    await ready(wrong.page);
    await wrong.page.waitForFunction(
      (h) => document.querySelector(".hash-line .hash")!.textContent === `${h} the link says 0123456789abcdef`,
      made.hash,
    );
    assert.deepEqual([...errors, ...other.errors, ...wrong.errors], []);
    for (const p of [page, other.page, wrong.page]) await p.context().close();
  });

  it("begin at the first frame where the pointer had a hand in it", async () => {
    const { page, errors } = await scene("structures/rope");
    const start = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      const start = await session.hash();
      await session.goto(2);
      await session.branch();
      await session.grab("rope", 30, [0, 0, 1]);
      await session.goto(5);
      await session.set("force.0.rate", 2);
      return start;
    });
    const inside = await unpack((await copied(page)).split("#/s/")[1]);
    await told(page, /What the pointer did is not in it/);
    assert.deepEqual([inside.frame, inside.hash, inside.changes], [0, start, [{ frame: 0, path: "force.0.rate", value: 2 }]]);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("that are damaged or hostile are refused in words, or do no harm", async () => {
    const good: Shared = {
      version: VERSION,
      text: readFileSync(`${SCENES}/structures/rope.toml`, "utf8"),
      overrides: [],
      scene: {},
      changes: [],
      frame: 0,
      hash: "",
    };
    const tree = (changed: object) => pack({ ...good, ...changed } as Shared);
    const bad = {
      "no link": "bm90IGEgbGluaw",
      "cut off": (await pack(good)).slice(0, 200),
      "not base64": "%%%",
      "more than a scene": await tree({ text: "#".repeat(3_000_000) }),
      "no text": await tree({ text: 5 }),
      "no frame": await tree({ frame: -1 }),
      "a frame that never comes": await tree({ frame: 1e12 }),
      "changes that come after": await tree({ changes: [{ frame: 5, path: "seed", value: 1 }] }),
      "changes without a value": await tree({ changes: [{ frame: 0, path: "seed", value: null }] }),
      "no scene": await tree({ scene: null }),
      "far too long": "A".repeat(700_000),
    };
    const { page, errors } = await own.open("theory", STILL);
    for (const [what, link] of Object.entries(bad)) {
      await page.evaluate((to) => {
        document.getElementById("main")!.replaceChildren();
        location.hash = `#/s/${to}`;
      }, link);
      await page.waitForSelector("text=The scene cannot be opened").catch(() => assert.fail(`${what}: it was opened`));
      const words = (await page.textContent("#main"))!;
      assert.match(
        words,
        /The link is damaged: (it (contains more|does not contain|exceeds)|part of it is missing).+\. Copy all of it/,
        what,
      );
    }
    // Refused by the engine: its message, and nothing executed.
    const markup = "<img src=x onerror=window.hit=1>";
    const hostile = [
      { text: `version = 1\ntitle = "${markup}"\n`, overrides: ["__proto__.polluted=1", `${markup}=1`] },
      { text: good.text, changes: [{ frame: 0, path: "__proto__.polluted", value: { polluted: 1 } }] },
      { text: `version = 1\nx = ${"[".repeat(100_000)}` },
      { text: good.text, version: markup, hash: markup },
      { text: '[[block]]\nname = "b"\nsize = [1, 1, 1]\nresolution = [5000, 5000, 5000]\nlinks = { structural = 1 }\n' },
    ];
    for (const changed of hostile) {
      const link = await tree(changed);
      await page.evaluate((to) => {
        delete document.getElementById("main")!.dataset.ready;
        location.hash = `#/s/${to}`;
      }, link);
      await ready(page);
      const seen = await page.evaluate(() => ({
        hit: (window as any).hit,
        polluted: ({} as any).polluted,
        images: document.querySelectorAll("img[src=x]").length,
      }));
      assert.deepEqual(seen, { hit: undefined, polluted: undefined, images: 0 });
    }
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("files", () => {
  /** File saved instead of a link. */
  const saved = async (page: Page) => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("text=Copy link")]);
    return { name: download.suggestedFilename(), data: readFileSync(await download.path()) };
  };

  it("hold what is too large for a link, and open at its frame with its hash", async () => {
    // Places that no packing makes short.
    let seed = 1;
    const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
    const places = Array.from({ length: 4000 }, () => [random(), random(), random()].map((x) => x.toFixed(6)).join(", "));
    const text = `version = 1\ntitle = "Many"\n[[particles]]\nname = "p"\nposition = [[${places.join("], [")}]]\n`;
    const first = await dropped("many.toml", Buffer.from(text));
    await ready(first.page);
    const hash = await first.page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(2);
      await session.set("world.gravity", [0, 0, -1]);
      await session.goto(5);
      return session.hash();
    });
    const { name, data } = await saved(first.page);
    await told(first.page, /too large for a link: it was saved as a file/);
    assert.equal(name, "many.tumble");
    const second = await dropped(name, data);
    await ready(second.page);
    await second.page.waitForFunction((h) => document.querySelector(".hash-line .hash")!.textContent === `${h} as in the file`, hash);
    assert.equal(await second.page.evaluate(() => (window as any).tumble.session.shown.index), 5);
    assert.equal(await second.page.textContent(".scene-id"), `from a file of tumble ${VERSION}`);
    assert.deepEqual([...first.errors, ...second.errors], []);
    await first.page.context().close();
    await second.page.context().close();
  });

  it("hold meshes of one's own, whose content is checked", async () => {
    const tent = Buffer.from("v 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1.5\nf 1 2 3\nf 2 4 3\n");
    const { page, errors } = await own.open("", STILL);
    await page.setInputFiles("#file", [
      { name: "tent.obj", mimeType: "text/plain", buffer: tent },
      {
        name: "camp.toml",
        mimeType: "text/plain",
        buffer: Buffer.from(
          'version = 1\n[[net]]\nname = "n"\nmesh = { path = "tent.obj" }\npin = ["vertex 0"]\n[[collider]]\nname = "b"\nshape = { mesh = { path = "bunny.ply" } }\n',
        ),
      },
    ]);
    await ready(page);
    const hash = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(4);
      return session.hash();
    });
    const { data } = await saved(page);
    await told(page, /contain custom meshes/);
    const inside = JSON.parse(gunzipSync(data).toString());
    // Bundled meshes are not in it.
    assert.deepEqual(Object.keys(inside.meshes), ["tent.obj"]);
    const second = await dropped("camp.tumble", data);
    await ready(second.page);
    await second.page.waitForFunction((h) => document.querySelector(".hash-line .hash")!.textContent === `${h} as in the file`, hash);
    // Another mesh under the name.
    inside.meshes["tent.obj"] = Buffer.from(tent.toString().replace("1.5", "1.6")).toString("base64");
    const third = await dropped("camp.tumble", gzipSync(JSON.stringify(inside)));
    await ready(third.page);
    assert.match((await third.page.textContent(".alert"))!, /content of "tent\.obj" has changed/);
    assert.deepEqual([...errors, ...second.errors, ...third.errors], []);
    for (const p of [page, second.page, third.page]) await p.context().close();
  });

  it("that are damaged or hostile are refused in words", async () => {
    const whole: Shared = { version: VERSION, text: "version = 1\n", overrides: [], scene: {}, changes: [], frame: 0, hash: "" };
    const good = Buffer.from(await (await toFile(whole, {})).arrayBuffer());
    assert.deepEqual((await fromFile(good)).shared, whole);
    const { page, errors } = await own.open("", STILL);
    const bad: [string, Buffer, RegExp][] = [
      ["not packed", Buffer.from("{}"), /x\.tumble is damaged: part of it/],
      ["cut off", good.subarray(0, good.length - 12), /x\.tumble is damaged: part of it/],
      ["empty", Buffer.alloc(0), /x\.tumble is damaged: part of it/],
      ["a mesh that is none", gzipSync(gunzipSync(good).toString().replace('"meshes":{}', '"meshes":{"a":"%"}')), /damaged: part of it/],
      ["no scene", gzipSync("[]"), /does not contain a scene/],
      ["no meshes", gzipSync(gunzipSync(good).toString().replace('"meshes":{}', '"meshes":[1]')), /does not contain its meshes/],
      ["a bomb", gzipSync(Buffer.alloc(200 * 2 ** 20)), /more than a scene may have/],
    ];
    for (const [, buffer, message] of bad) {
      await page.evaluate(() => document.getElementById("say")?.remove());
      await page.setInputFiles("#file", { name: "x.tumble", mimeType: "application/gzip", buffer });
      await told(page, message);
    }
    await assert.rejects(toFile(whole, { "a.ply": new Uint8Array(65 * 2 ** 20) }), /65 MiB; a file can hold 64/);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("a site", () => {
  /** A static host that has the folder at some place, and its page for what is not found. */
  let server: Server;
  let place = "";
  before(async () => {
    const types: Record<string, string> = {
      html: "text/html",
      js: "text/javascript",
      css: "text/css",
      wasm: "application/wasm",
      webp: "image/webp",
      svg: "image/svg+xml",
      webmanifest: "application/manifest+json",
    };
    server = createServer((request, response) => {
      const path = new URL(request.url!, "http://x").pathname.replace(/^\/some\/place\//, "");
      let file = join(DIST, path.endsWith("/") || !path ? `${path}index.html` : path);
      const there = !path.startsWith("/") && existsSync(file) && statSync(file).isFile();
      if (!there) file = join(DIST, "404.html");
      response.writeHead(there ? 200 : 404, { "Content-Type": types[file.split(".").pop()!] ?? "application/octet-stream" });
      response.end(readFileSync(file));
    });
    await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
    place = `http://127.0.0.1:${(server.address() as AddressInfo).port}/some/place/`;
  });
  after(() => server?.close());

  it("holds each version once, and works at any place", async () => {
    assert.equal(readdirSync(join(DIST, "v", VERSION, "assets")).filter((f) => /^single_bg.*wasm$/.test(f)).length, 1);
    assert.deepEqual(
      readdirSync(DIST)
        .filter((f) => f !== "v")
        .sort(),
      ["404.html", "index.html"],
    );
    for (const where of ["", `v/${VERSION}/`]) {
      const { page, errors } = await visit(`${place}${where}#/scene/structures/rope`);
      await ready(page);
      assert.ok((await copied(page)).startsWith(`${place}v/${VERSION}/#/s/`));
      // The engine of a folder has its name.
      assert.equal(await page.evaluate(() => (window as any).tumble.engine.version), VERSION);
      assert.deepEqual(errors, []);
      await page.context().close();
    }
  });

  it("has a picture, icons and a manifest for those who show or keep its links", () => {
    const size = (file: string) => {
      const data = readFileSync(file);
      if (file.endsWith(".png")) return [data.readUInt32BE(16), data.readUInt32BE(20)];
      // The frame header of a JPEG.
      const at = data.indexOf(Buffer.from([0xff, 0xc0]));
      return [data.readUInt16BE(at + 7), data.readUInt16BE(at + 5)];
    };
    for (const folder of [DIST, join(DIST, "v", VERSION)]) {
      const page = readFileSync(join(folder, "index.html"), "utf8");
      const of = (pattern: RegExp) => join(folder, pattern.exec(page)?.[1] ?? assert.fail(`no ${pattern} in ${folder}`));
      assert.deepEqual(size(of(/property="og:image" content="([^"]+)"/)), [1200, 630]);
      assert.deepEqual(size(of(/rel="apple-touch-icon" href="([^"]+)"/)), [192, 192]);
      assert.match(readFileSync(of(/rel="icon" href="([^"]+)"/), "utf8"), /<svg/);
      const manifest = of(/rel="manifest" href="([^"]+)"/);
      const { icons, start_url } = JSON.parse(readFileSync(manifest, "utf8"));
      assert.ok(existsSync(join(manifest, "..", start_url, "index.html")));
      for (const { src, sizes } of icons.filter((i: any) => i.type === "image/png"))
        assert.equal(size(join(manifest, "..", src)).join("x"), sizes);
      assert.equal(icons.length, 3);
      for (const word of ["title", "description", "image:alt"]) assert.match(page, new RegExp(`property="og:${word}" content="[^"]{6,}"`));
    }
  });

  it("says which version is not kept there, and opens the scene with its own", async () => {
    const first = await scene("structures/rope");
    const link = await copied(first.page);
    const packed = link.split("#/s/")[1];
    const { page } = await visit(`${place}v/9.8.7/#/s/${packed}`);
    assert.equal(await page.textContent("h1"), "tumble 9.8.7 is not available here");
    const hash = await first.page.evaluate(() => (window as any).tumble.session.hash());
    await page.click(`text=Open the scene with version ${VERSION}`);
    await ready(page);
    assert.equal(page.url(), `${place}v/${VERSION}/#/s/${packed}`);
    await page.waitForFunction((h) => document.querySelector(".hash-line .hash")!.textContent === `${h} as in the link`, hash);
    // Anything else that is not there has no way to lead astray.
    await page.goto(`${place}v/<img src=x onerror=alert(1)>/`);
    assert.equal(await page.textContent("h1"), "tumble <img src=x onerror=alert(1)> is not available here");
    await page.goto(`${place}nothing`);
    assert.equal(await page.textContent("h1"), "Page not found");
    assert.equal(await page.isVisible("#way"), false);
    await first.page.context().close();
    await page.context().close();
  });
});

describe("scenes that ship", () => {
  it("are the same when all of their values are written out", async () => {
    const pkg = resolve("src/engine/pkg");
    const [single, double] = await Promise.all(["single", "double"].map((name) => import(`${pkg}/${name}.js`)));
    single.initSync({ module: readFileSync(`${pkg}/single_bg.wasm`) });
    double.initSync({ module: readFileSync(`${pkg}/double_bg.wasm`) });
    const ids = [...new Set([...tried(0), "drape/sheet-on-bunny", "structures/others"])];
    const failures: string[] = [];
    let meshes = 0;
    for (const id of ids) {
      const text = readFileSync(`${SCENES}/${id}.toml`, "utf8");
      const files = new Map(
        [...text.matchAll(/path = "(\.\.\/assets\/[^"]+)"/g)].map(([, path]) => [
          path,
          new Uint8Array(readFileSync(join(SCENES, "x", path))),
        ]),
      );
      const engine = single.precision(text, []) === "double" ? double : single;
      const made = (words: string) => {
        const world = new engine.World(words, [], files);
        const info = JSON.parse(world.info()) as SceneInfo;
        world.free();
        return info;
      };
      const one = made(text);
      meshes += meshesOf(one.scene).length;
      const two = made(written(one.scene));
      if (!alike(one.scene, two.scene) || one.hash !== two.hash) failures.push(id);
    }
    assert.ok(ids.length >= (WHOLE ? 40 : 20) && meshes >= 2, `${ids.length} scenes, ${meshes} meshes`);
    assert.deepEqual(failures, []);
    assert.equal(alike({ a: [1, { b: null }] }, { a: [1, { b: 2 }] }), false);
    assert.equal(alike({ a: 1, b: 2 }, { b: 2, a: 1 }), true);
    assert.equal(alike({ a: 1 }, { a: 1, b: 2 }), false);
  });
});
