/** Time branches: a world goes another way, the two are compared, and the old one is taken again. */
import assert from "node:assert/strict";
import { after, before, describe, it } from "node:test";
import type { Page } from "playwright-core";
import { type Lab, lab, ready, STILL, serious } from "./browser.ts";

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

/** How far the two ways are apart, frame by frame. */
const apart = (page: Page, last: number) =>
  page.evaluate((end) => Array.from({ length: end + 1 }, (_, i) => (window as any).tumble.comparison.at(i) as number | null), last);

/** To frame 10, back to frame 4, another value, to frame 10 again. Answers with the hash of the first way. */
const branch = (page: Page, path: string, value: number) =>
  page.evaluate(
    async ([where, what]) => {
      const { session } = (window as any).tumble;
      await session.goto(10);
      const hash = await session.hash();
      session.scrub(4);
      await session.set(where, what);
      await session.goto(10);
      return hash as string;
    },
    [path, value] as const,
  );

describe("branches", () => {
  it("of the same value are one", async () => {
    const { page, errors } = await open("structures/rope");
    assert.equal(await page.isVisible(".before"), false);
    await branch(page, "force.0.rate", 1);
    assert.deepEqual(await apart(page, 10), Array(11).fill(0));
    assert.match((await page.textContent(".before .changes"))!, /force\.0\.rate: 1 → 1, from frame 4/);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("of other values part at the frame of the change, and the old one comes back with its hash", async () => {
    const { page, errors } = await open("structures/rope");
    const old = await branch(page, "force.0.rate", 3);
    const lengths = (await apart(page, 10)) as number[];
    assert.deepEqual(lengths.slice(0, 5), Array(5).fill(0));
    for (let i = 5; i <= 10; i++) assert.ok(lengths[i] > lengths[i - 1], `${lengths}`);
    // By hand: the lengths between the 61 masses.
    const by = await page.evaluate(() => {
      const { session } = (window as any).tumble;
      const [a, b] = [session.shown, session.before.way.frame(10)].map((f: any) => f.columns.rope.position.data as Float32Array);
      return Math.sqrt(a.reduce((sum, v, i) => sum + (v - b[i]) ** 2, 0) / (a.length / 3));
    });
    assert.ok(Math.abs(lengths[10] / by - 1) < 1e-12, `${lengths[10]}, by hand ${by}`);
    assert.match((await page.textContent(".before .changes"))!, /force\.0\.rate: 1 → 3, from frame 4/);
    assert.equal(await page.textContent(".before code"), old);
    const now = await page.evaluate(() => (window as any).tumble.session.hash());
    assert.notEqual(now, old);

    await page.click("text=Return to the previous branch");
    await page.waitForFunction((h) => document.querySelector(".hash-line .hash")!.textContent === h, old);
    const taken = await page.evaluate(() => {
      const { session } = (window as any).tumble;
      return { index: session.latest, rate: session.info.scene.force[0].rate, beside: session.overrides.size };
    });
    assert.deepEqual(taken, { index: 10, rate: 1, beside: 0 });
    assert.match((await page.textContent(".before .changes"))!, /force\.0\.rate: 3 → 1, from frame 4/);
    assert.equal(await page.textContent(".before code"), now);
    assert.deepEqual(await apart(page, 10), lengths);
    // It goes on as if nothing had been.
    const on = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(13);
      const hash = await session.hash();
      await session.reset();
      await session.goto(13);
      return [hash, await session.hash()];
    });
    assert.equal(on[0], on[1]);
    await page.click("text=Discard it");
    await page.waitForSelector(".before", { state: "hidden" });
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("are compared as far as both go, and the old one is run as far", async () => {
    const { page, errors } = await open("structures/rope");
    await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(3);
      await session.set("force.0.rate", 3);
      await session.set("force.0.rate", 5);
      await session.goto(8);
    });
    assert.deepEqual((await apart(page, 8)).slice(3), [0, null, null, null, null, null]);
    const now = await page.evaluate(() => (window as any).tumble.session.hash());
    await page.click("text=Advance the previous branch as far");
    await page.waitForSelector(".catch-up", { state: "detached" });
    const lengths = (await apart(page, 8)) as number[];
    assert.equal(lengths[3], 0);
    assert.ok(
      lengths.slice(4).every((l, i) => l > lengths[3 + i]),
      `${lengths}`,
    );
    assert.equal(await page.evaluate(() => (window as any).tumble.session.hash()), now);
    assert.match((await page.textContent(".before .changes"))!, /rate: 1 → 5, from frame 3$/);
    // The old one is what it would have been.
    const old = (await page.textContent(".before code"))!;
    await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.load(session.toml);
      await session.goto(8);
    });
    assert.equal(await page.evaluate(() => (window as any).tumble.session.hash()), old);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("stay as they are where a change is refused", async () => {
    const { page, errors } = await open("structures/rope");
    const seen = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(6);
      const hash = await session.hash();
      session.scrub(2);
      const message = await session.set("force.0.rate", "nonsense").then(
        () => "taken",
        (e: Error) => e.message,
      );
      return { message, before: session.before, latest: session.latest, same: hash === (await session.hash()) };
    });
    assert.notEqual(seen.message, "taken");
    assert.deepEqual({ ...seen, message: "" }, { message: "", before: null, latest: 6, same: true });
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("differ in the field that is shown, in its unit, and show their difference", async () => {
    const { page, errors } = await open("gas/ink");
    await branch(page, "gas.0.viscosity", 5);
    const values = (await apart(page, 10)) as number[];
    assert.deepEqual(values.slice(0, 5), Array(5).fill(0));
    // Viscosity acts on the velocity now, on the density a step later.
    assert.ok(
      values.slice(6).every((v, i) => v > values[5 + i]),
      `${values}`,
    );
    assert.match((await page.textContent(".apart"))!, /kg\/m³.*density/);
    const hash = await page.evaluate(() => (window as any).tumble.session.hash());
    await page.locator("label:has-text('Branch shown') select").selectOption("difference");
    const legend = await page.evaluate(() => (window as any).tumble.stage.legend);
    assert.equal(legend.name, "difference");
    assert.ok(legend.high > 0 && legend.low === -legend.high, JSON.stringify(legend));
    await page.locator("label:has-text('Branch shown') select").selectOption("before");
    assert.equal(
      await page.evaluate(() => {
        const { session, stage } = (window as any).tumble;
        return stage.frame === session.before.way.frame(10);
      }),
      true,
    );
    assert.equal(await page.evaluate(() => (window as any).tumble.session.hash()), hash);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("begin anew where sizes change, and the old one is there", async () => {
    const { page, errors } = await open("structures/rope");
    const old = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(5);
      const hash = await session.hash();
      const live = await session.set("rope.0.segments", 20);
      await session.goto(5);
      return { hash, live };
    });
    assert.equal(old.live, false);
    assert.deepEqual(await apart(page, 5), Array(6).fill(null));
    await page.click("text=Return to the previous branch");
    await page.waitForFunction((h) => document.querySelector(".hash-line .hash")!.textContent === h, old.hash);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("are two after the pointer's work, and after a start from frame 0, too", async () => {
    const { page, errors } = await open("structures/rope");
    const seen = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.goto(10);
      const straight = await session.hash();
      session.scrub(4);
      await session.branch();
      await session.grab("rope", 30, [0, 0, 1]);
      await session.goto(10);
      await session.release();
      const changes = session.before.changes.map((c: any) => [c.path, c.frame]);
      const pulled = await session.hash();
      await session.takeBefore();
      const again = await session.hash();
      // From the start, with another value: the way that was left is the old one.
      await session.forgetBefore();
      await session.reset();
      const silent = session.before;
      await session.goto(2);
      await session.set("force.0.rate", 3);
      const at = [session.before.at, session.before.way.last];
      await session.goto(10);
      const other = await session.hash();
      await session.takeBefore();
      return { straight, pulled, again, changes, silent, at, other, back: await session.hash(), turned: session.before.hash };
    });
    assert.equal(seen.again, seen.straight);
    assert.notEqual(seen.pulled, seen.straight);
    assert.deepEqual(seen.changes, [["", 4]]);
    assert.equal(seen.silent, null);
    assert.deepEqual(seen.at, [2, 10]);
    assert.notEqual(seen.other, seen.straight);
    assert.equal(seen.back, seen.straight);
    assert.equal(seen.turned, seen.other);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  for (const colorScheme of ["light", "dark"] as const) {
    it(`are told without anything serious by axe, ${colorScheme}`, async () => {
      const { page } = await own.open("scene/structures/rope", { ...STILL, colorScheme, bypassCSP: true });
      await ready(page);
      await page.evaluate(async () => {
        const { session } = (window as any).tumble;
        await session.goto(3);
        await session.set("force.0.rate", 3);
        await session.goto(6);
      });
      await page.waitForSelector(".catch-up");
      assert.deepEqual(await serious(page), []);
      await page.context().close();
    });
  }
});
