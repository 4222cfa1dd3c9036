/** Links and shared files that anybody may have written: refused in words, or a share that is whole. `TUMBLE_FUZZ=20` tries twenty times as many. */
import assert from "node:assert/strict";
import { appendFileSync, readFileSync } from "node:fs";
import { resolve } from "node:path";
import { test } from "node:test";
import { constants, deflateRawSync, gunzipSync, gzipSync, inflateRawSync } from "node:zlib";
import { fromFile, pack, type Shared, toFile, unpack } from "../src/share";
import { alike } from "../src/values";

const FACTOR = Number(process.env.TUMBLE_FUZZ ?? 1);
const cases = (base: number) => Math.max(Math.round(base * FACTOR), 1);
/** Seconds that a case may take; measured: 0.1 on a busy machine. */
const SLOWEST = 10;

const TEXT = readFileSync(resolve(import.meta.dirname, "../../python/tumble/scenes/structures/rope.toml"), "utf8");
const GOOD: Shared = {
  version: "0.1.0",
  text: TEXT,
  overrides: ["time.fps=30"],
  scene: { title: "Rope", seed: 0, rope: [{ name: "rope", from: [0, 0, 1] }], force: [] },
  changes: [
    { frame: 0, path: "force.0.rate", value: 2.5 },
    { frame: 6, path: "world.gravity", value: [0, 0, -3] },
  ],
  frame: 12,
  hash: "0123456789abcdef",
};
const MESHES = { "tent.obj": new TextEncoder().encode("v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n"), "b.ply": new Uint8Array(40) };

/** Random numbers from a seed. */
function dice(seed: number) {
  let a = seed >>> 0;
  const next = () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
  const below = (n: number) => Math.floor(next() * n);
  return { below, one: <T>(items: readonly T[]): T => items[below(items.length)], chance: (p: number) => next() < p };
}
type Dice = ReturnType<typeof dice>;

/** Up to three bytes changed; sometimes a part is lost, repeated or cut off. */
function spoiled(whole: Uint8Array, d: Dice): Buffer {
  let data = Buffer.from(whole);
  for (let n = d.one([1, 1, 2, 3]); n > 0; n--) data[d.below(data.length)] = d.chance(0.5) ? d.below(256) : d.one([0, 1, 127, 128, 255]);
  if (d.chance(0.2)) {
    const at = d.below(data.length),
      more = d.below(20);
    data = Buffer.concat([
      data.subarray(0, at),
      d.chance(0.5) ? data.subarray(at, at + more) : Buffer.alloc(0),
      data.subarray(at + (d.chance(0.5) ? more : 0)),
    ]);
  }
  return d.chance(0.1) ? data.subarray(0, d.below(data.length + 1)) : data;
}

const ODD = [
  "null",
  "true",
  "-1",
  "0",
  "1.5",
  "1e999",
  "1e6",
  "1000001",
  "9007199254740993",
  '""',
  '"x"',
  '"\\ud800"',
  '"\\u0000"',
  '"%%%"',
  '"__proto__"',
  "[]",
  "[null]",
  "[[]]",
  "{}",
  '{"a":1}',
  '{"__proto__":{"polluted":1}}',
  '{"frame":0,"path":"seed","value":1}',
  `${"[".repeat(3000)}${"]".repeat(3000)}`,
];

const NUMBERS = ["-1", "0", "5", "13", "1.5", "1e999", "1000000", "1000001", "9007199254740993"];

/** JSON with something else at a place of its tree; values come as text, so that those may be there that JavaScript would not write. */
function changed(tree: unknown, d: Dice): string {
  const copy = structuredClone(tree) as Record<string, unknown>;
  const marks: string[] = [];
  for (let n = d.one([1, 1, 2, 4]); n > 0; n--) {
    let holder: any = copy,
      key: string;
    for (;;) {
      const keys = Object.keys(holder);
      if (!keys.length) break;
      key = d.one(keys);
      const below = holder[key];
      if (below && typeof below === "object" && Object.keys(below).length && d.chance(0.6)) {
        holder = below;
        continue;
      }
      const [remove, repeat] = [d.chance(0.2), d.chance(0.2)];
      if (remove) Array.isArray(holder) ? holder.splice(Number(key), 1) : delete holder[key];
      else if (repeat)
        Array.isArray(holder)
          ? holder.push(below)
          : (holder[d.one(["__proto__x", "tumble", "text", "frame", "meshes", "constructor", "toString"])] = below);
      else holder[key] = `\u0001${marks.push(d.one(typeof below === "number" && d.chance(0.7) ? NUMBERS : ODD)) - 1}\u0001`;
      break;
    }
  }
  const text = JSON.stringify(copy)
    .replace(/"\\u0001(\d+)\\u0001"/g, (_, i) => marks[Number(i)])
    .replace(/__proto__x/g, "__proto__");
  // The text itself, too: not JSON any more, mostly.
  return d.chance(0.1) ? spoiled(Buffer.from(text), d).toString() : text;
}

/** Whether a share is one, by rules of its own. */
function whole(s: Shared): boolean {
  const place = (n: unknown) => typeof n === "number" && Number.isSafeInteger(n) && n >= 0 && n <= 1_000_000;
  return (
    [s.version, s.text, s.hash, ...s.overrides].every((t) => typeof t === "string") &&
    place(s.frame) &&
    s.scene !== null &&
    typeof s.scene === "object" &&
    !Array.isArray(s.scene) &&
    Array.isArray(s.overrides) &&
    Array.isArray(s.changes) &&
    s.changes.length <= 10_000 &&
    s.changes.every(
      (c) => place(c.frame) && c.frame <= s.frame && typeof c.path === "string" && c.value !== null && c.value !== undefined,
    ) &&
    Object.keys(s).sort().join() === "changes,frame,hash,overrides,scene,text,version"
  );
}

/** Tries cases, each from its seed: an error with a message, or what `read` says is sound. */
async function tried(kind: string, count: number, read: (d: Dice) => Promise<unknown>): Promise<{ read: number; refused: number }> {
  const ends = { read: 0, refused: 0 };
  let slowest = 0;
  for (let seed = 0; seed < count; seed++) {
    const begin = performance.now();
    try {
      await read(dice(seed));
      ends.read++;
    } catch (error) {
      if (error instanceof assert.AssertionError) throw new Error(`${kind}, seed ${seed}`, { cause: error });
      assert.ok(error instanceof Error && error.message && error.message.length < 300, `${kind}, seed ${seed}: ${error}`);
      ends.refused++;
    }
    slowest = Math.max(slowest, (performance.now() - begin) / 1000);
  }
  assert.equal((Object.prototype as { polluted?: unknown }).polluted, undefined);
  console.log(`${kind}: ${count} cases, ${ends.refused} refused, ${ends.read} read, ${slowest.toFixed(2)} s at most`);
  if (process.env.TUMBLE_COUNTS) {
    const line = { count: "random cases", kind, cases: count, ...ends, slowest: `${slowest.toFixed(2)} s` };
    appendFileSync(process.env.TUMBLE_COUNTS, `${JSON.stringify(line)}\n`);
  }
  assert.ok(slowest < SLOWEST, `${kind}: a case of ${slowest} s`);
  return ends;
}

const base64url = (data: Uint8Array) => Buffer.from(data).toString("base64url");

async function link(text: string): Promise<void> {
  const found = await unpack(text);
  assert.ok(whole(found), JSON.stringify(found).slice(0, 300));
  // The result is packed again to the same.
  assert.ok(alike(JSON.parse(JSON.stringify(await unpack(await pack(found)))), JSON.parse(JSON.stringify(found))));
}

async function file(data: Uint8Array): Promise<void> {
  const { shared, meshes } = await fromFile(data);
  assert.ok(whole(shared));
  assert.ok(Object.values(meshes).every((bytes) => bytes instanceof Uint8Array && bytes.length < 1000));
}

test("changed links are refused in words or whole", async () => {
  const packed = Buffer.from(await pack(GOOD), "base64url");
  const text = inflateRawSync(packed);
  const ends = await tried("links, changed", cases(300), async (d) => {
    if (d.chance(0.3)) return link(spoiled(Buffer.from(await pack(GOOD)), d).toString("latin1"));
    // The stream is sound, so that what is in it is reached.
    return link(base64url(d.chance(0.5) ? spoiled(packed, d) : deflateRawSync(spoiled(text, d))));
  });
  assert.ok(ends.refused > ends.read && ends.read > 0);
});

test("links with changed trees are refused in words or whole", async () => {
  const { version, ...rest } = GOOD;
  const ends = await tried("links, other trees", cases(300), (d) =>
    link(base64url(deflateRawSync(changed({ tumble: version, ...rest }, d)))),
  );
  assert.ok(Math.min(ends.refused, ends.read) > 0.05 * (ends.refused + ends.read));
});

test("changed files are refused in words or whole", async () => {
  const good = Buffer.from(await (await toFile(GOOD, MESHES)).arrayBuffer());
  const tree = JSON.parse(gunzipSync(good).toString());
  const ends = await tried("shared files, changed", cases(400), (d) => file(d.chance(0.5) ? spoiled(good, d) : gzipSync(changed(tree, d))));
  assert.ok(Math.min(ends.refused, ends.read) > 0.05 * (ends.refused + ends.read));
});

/** A stream of so many MiB of the same letter, in a thousandth of that: whole blocks, one after the other. */
function bomb(beginning: string, size: number): Buffer {
  const block = (text: string | Buffer) => deflateRawSync(text, { finishFlush: constants.Z_FULL_FLUSH });
  return Buffer.concat([block(beginning), ...Array<Buffer>(size).fill(block(Buffer.alloc(2 ** 20, "#"))), deflateRawSync("")]);
}

test("what unpacks to more than there may be is left off early", async () => {
  // The content before is sound: the length is refused.
  const beginning = '{"tumble":"0.1.0","text":"';
  const head = gzipSync("").subarray(0, 10);
  const bombs = [
    { kind: "links", open: (size: number) => unpack(base64url(bomb(beginning, size))), holds: 1, sizes: [2, 30, 400] },
    { kind: "files", open: (size: number) => fromFile(Buffer.concat([head, bomb(beginning, size)])), holds: 95, sizes: [97, 500, 4000] },
  ];
  for (const { kind, open, holds, sizes } of bombs) {
    const before = process.resourceUsage().maxRSS / 1024;
    // Below the limit it is what is in it that is refused.
    await assert.rejects(open(holds), (error: Error) => !!error.message && !/more than a scene/.test(error.message));
    const { refused } = await tried(`${kind}, bombs`, sizes.length * 3, (d) =>
      open(d.one(sizes)).catch((error) => {
        assert.match(error.message, /it contains more than a scene may have/);
        throw error;
      }),
    );
    const taken = process.resourceUsage().maxRSS / 1024 - before;
    console.log(`${kind}, bombs: ${taken.toFixed(0)} MiB`);
    // Of 400 MiB and 4 GiB; what is read up to the limit is there in parts, whole, and as text. Measured: 36 and 113 MiB.
    assert.ok(refused === sizes.length * 3 && taken < 4 * holds + 64, `${taken} MiB`);
  }
});
