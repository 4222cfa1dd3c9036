/** The pages of the fluid and of the integrators in a real browser. Needs `dist` (make web) and Chromium. */
import assert from "node:assert/strict";
import { after, before, describe, it } from "node:test";
import { type Lab, lab, ready, STILL } from "./browser.ts";

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

describe("fluid", () => {
  it("is stirred by the pointer, and its pressure is as good as its iterations", async () => {
    const { page, errors } = await own.open("fluid", STILL);
    await ready(page);
    const picture = () =>
      page.evaluate(async () => {
        const { stage } = (window as any).tumble;
        const image = await createImageBitmap(await stage.picture());
        const small = new OffscreenCanvas(128, 72);
        const context = small.getContext("2d")!;
        context.drawImage(image, 0, 0, 128, 72);
        return [...context.getImageData(0, 0, 128, 72).data];
      });
    const differ = (a: number[], b: number[]) => a.reduce((s, v, i) => s + (Math.abs(v - b[i]) > 12 ? 1 : 0), 0) / a.length;
    const calm = await picture();
    const box = (await page.locator(".stage").boundingBox())!;
    await page.mouse.move(box.x + 0.3 * box.width, box.y + 0.15 * box.height);
    await page.mouse.down();
    for (let i = 1; i <= 8; i++) {
      await page.mouse.move(box.x + (0.3 + 0.05 * i) * box.width, box.y + (0.15 + 0.02 * i) * box.height);
      await page.waitForTimeout(60);
    }
    await page.mouse.up();
    await page.evaluate(() => (window as any).tumble.session.pause());
    const stirred = await picture();
    assert.ok(differ(calm, stirred) > 0.01, `stirring changed ${differ(calm, stirred)}`);
    await page.selectOption("#view", "pressure");
    await page.waitForFunction(() => (window as any).tumble.stage.legend?.name === "pressure");
    const pressure = await picture();
    assert.ok(differ(stirred, pressure) > 0.1, `the view of the pressure changed ${differ(stirred, pressure)}`);
    // Cells are seen there by themselves, at every resolution, and go at once, also while nothing moves.
    const edges = () =>
      page.evaluate(async () => {
        const image = await createImageBitmap(await (window as any).tumble.stage.picture());
        const { width, height } = image;
        const context = new OffscreenCanvas(width, height).getContext("2d")!;
        context.drawImage(image, 0, 0);
        const { data } = context.getImageData(0, Math.round(height / 2) - 10, width, 20);
        let jumps = 0;
        // Of a smooth field the second differences are small.
        for (let p = 8; p < data.length; p += 4)
          for (let c = 0; c < 3; c++) jumps += Math.abs(data[p + c] - 2 * data[p + c - 4] + data[p + c - 8]);
        return jumps / data.length;
      });
    const switched = page.locator("label:has-text('Cells') input[type=checkbox]");
    for (const n of ["64", "384"]) {
      await page.locator("label:has-text('Cells along') select").selectOption(n);
      await page.waitForFunction((k) => (window as any).tumble.session.info.scene.gas[0].box.resolution === Number(k), n);
      // It plays by itself then.
      await page.waitForFunction(() => (window as any).tumble.session.playing);
      await page.evaluate(async () => {
        const { session } = (window as any).tumble;
        session.pause();
        await session.next();
      });
      assert.equal(await switched.isChecked(), true);
      const ruled = await edges();
      await switched.uncheck();
      const smooth = await edges();
      await switched.check();
      assert.ok(ruled > 2 * smooth && ruled - smooth > 0.5, `${n}: ${ruled} with cells, ${smooth} without`);
    }
    // A pointer that passes over stirs while it plays, and not while it rests.
    const passes = async () => {
      await page.evaluate(() => {
        const { session } = (window as any).tumble;
        const stir = Object.getPrototypeOf(session).stir;
        (window as any).passed = [];
        session.stir = (...words: unknown[]) => ((window as any).passed.push(words), stir.apply(session, words));
      });
      for (let i = 0; i < 8; i++) await page.mouse.move(box.x + (0.3 + 0.04 * i) * box.width, box.y + 0.5 * box.height);
      return page.evaluate(() => (window as any).passed);
    };
    assert.deepEqual(await passes(), []);
    await page.locator("label:has-text('Cells along') select").selectOption("64");
    await page.waitForFunction(() => (window as any).tumble.session.info.scene.gas[0].box.resolution === 64);
    await page.waitForFunction(() => (window as any).tumble.session.playing);
    const stirring = await passes();
    assert.ok(stirring.length && stirring.every((w: any) => w[2][0] > 0 && w[4] === 0), JSON.stringify(stirring));
    await page.evaluate(() => (window as any).tumble.session.pause());
    // Few iterations of Jacobi leave much more than multigrid does.
    const left = await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      await session.next();
      const good = session.report.pressure.at(-1);
      await session.set("gas.0.pressure.method", "jacobi");
      await session.set("gas.0.pressure.iterations", 5);
      await session.next();
      return { good, bad: session.report.pressure.at(-1), unconverged: session.report.unconverged };
    });
    assert.ok(left.bad > 10 * left.good && left.unconverged > 0, JSON.stringify(left));
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("has curves in colours of light and of dark", async () => {
    const { page, errors } = await own.open("fluid", { ...STILL, colorScheme: "light" });
    await ready(page);
    await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      for (let i = 0; i < 6; i++) await session.next();
      // The plot takes so many frames at once.
      await new Promise((done) => setTimeout(done, 200));
      await session.next();
    });
    const seen = () =>
      page.evaluate(async () => {
        await new Promise((done) => setTimeout(done, 100));
        const canvas = document.querySelector<HTMLCanvasElement>(".energy canvas")!;
        const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
        const [light, dark] = [
          [0x2a, 0x6f, 0x97],
          [0x6d, 0xb6, 0xe3],
        ].map(([r, g, b]) => {
          let n = 0;
          for (let i = 0; i < data.length; i += 4)
            if (data[i + 3] > 200 && Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 12) n++;
          return n > 10;
        });
        return { light, dark };
      });
    assert.deepEqual(await seen(), { light: true, dark: false });
    await page.click("[aria-label='Toggle light and dark']");
    assert.deepEqual(await seen(), { light: false, dark: true });
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("is stirred in space, too, in the slice that is shown", async () => {
    const { page, errors } = await own.open("fluid", STILL);
    await ready(page);
    await page.selectOption("#space", "slice");
    await page.waitForFunction(() => (window as any).tumble.session.info.dimension === 3);
    await page.selectOption("#view", "pressure");
    await page.evaluate(async () => {
      const { session } = (window as any).tumble;
      session.pause();
      await session.next();
    });
    // A pressure has both signs; only what is looked through like smoke has not.
    const { low, high } = await page.evaluate(() => (window as any).tumble.stage.legend);
    assert.ok(low < 0 && low === -high, `${low} to ${high}`);
    const box = (await page.locator(".stage").boundingBox())!;
    const before = await page.evaluate(() => (window as any).tumble.session.hash());
    const at = await page.evaluate(
      ([x, y]) => {
        const { session, stage } = (window as any).tumble;
        const all: number[][] = [];
        const stir = session.stir.bind(session);
        session.stir = (gas: string, position: number[], ...rest: unknown[]) => (all.push(position), stir(gas, position, ...rest));
        session.play = () => {};
        (window as any).stirred = all;
        stage.look.sliceAt = 0.75;
        return stage.under({ clientX: x, clientY: y }, stage.stirred.through).toArray();
      },
      [box.x + 0.6 * box.width, box.y + 0.5 * box.height] as const,
    );
    assert.ok(Math.abs(at[1] - 0.125) < 1e-6, `${at}`);
    await page.mouse.move(box.x + 0.4 * box.width, box.y + 0.5 * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.5 * box.height, { steps: 4 });
    await page.waitForFunction(() => (window as any).stirred.length);
    await page.mouse.up();
    assert.notEqual(await page.evaluate(() => (window as any).tumble.session.hash()), before);
    assert.ok((await page.evaluate(() => (window as any).stirred)).every((p: number[]) => Math.abs(p[1] - 0.125) < 1e-6));
    // And again: letting go does not give the pointer to the camera.
    await page.evaluate(() => ((window as any).stirred.length = 0));
    await page.mouse.down();
    await page.mouse.move(box.x + 0.6 * box.width, box.y + 0.5 * box.height, { steps: 4 });
    await page.waitForFunction(() => (window as any).stirred.length);
    await page.mouse.up();
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  it("is stirred by several fingers", async () => {
    const { page, errors } = await own.open("fluid", { ...STILL, viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
    await ready(page);
    await page.evaluate(() => {
      const { session } = (window as any).tumble;
      const all: number[][] = [];
      session.stir = async (_: string, position: number[]) => void all.push(position);
      (window as any).stirred = all;
    });
    const box = (await page.locator(".stage").boundingBox())!;
    const touch = await page.context().newCDPSession(page);
    const fingers = (k: number) =>
      [0.25, 0.75].map((x, id) => ({ x: box.x + (x + 0.02 * k) * box.width, y: box.y + 0.5 * box.height, id }));
    await touch.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: fingers(0) });
    for (let k = 1; k < 5; k++) await touch.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: fingers(k) });
    await touch.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
    const sides = (await page.evaluate(() => (window as any).stirred)).map((p: number[]) => p[0] < 0);
    assert.ok(sides.includes(true) && sides.includes(false), `${sides}`);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("walls", () => {
  it("are drawn into the fluid while it flows", async () => {
    const { page, errors } = await own.open("fluid", STILL);
    await ready(page);
    await page.evaluate(() => (window as any).tumble.session.goto(3));
    await page.locator("label:has-text('Dragging') select").selectOption("draw");
    const box = (await page.locator(".stage").boundingBox())!;
    await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.3 * box.height);
    await page.mouse.down();
    for (let i = 1; i < 8; i++) await page.mouse.move(box.x + (0.5 + 0.02 * i) * box.width, box.y + (0.3 + 0.05 * i) * box.height);
    await page.mouse.up();
    await page.waitForFunction(() => (window as any).tumble.session.info.objects.some((o: any) => o.kind === "collider"));
    assert.ok((await page.evaluate(() => (window as any).tumble.session.latest)) >= 3, "the fluid began anew");
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});

describe("integrators", () => {
  it("blow up and decay as their formulas say", async () => {
    const { page, errors } = await own.open("integrators");
    await page.click("text=Implicit damping");
    const shown = (scheme: string, steps: number) =>
      page
        .waitForFunction(
          ([s, n]) => {
            const out = document.querySelector(`[data-ratio=${s}]`) as HTMLElement | null;
            return out && Number(out.dataset.steps) >= Number(n)
              ? { ratio: Number(out.dataset.value), steps: Number(out.dataset.steps) }
              : false;
          },
          [scheme, steps] as const,
        )
        .then((handle) => handle.jsonValue() as Promise<{ ratio: number; steps: number }>);
    // z = 2π 0.05: implicit Euler keeps 1/(1 + z²) of the energy a step.
    const z = 2 * Math.PI * 0.05;
    const implicit = await shown("implicit_euler", 20);
    const exact = (1 + z * z) ** -implicit.steps;
    assert.ok(Math.abs(implicit.ratio / exact - 1) < 1e-6, `${implicit.ratio}, expected ${exact}`);
    const midpoint = await shown("implicit_midpoint", 20);
    assert.ok(Math.abs(midpoint.ratio - 1) < 1e-6, `${midpoint.ratio}`);
    await page.click("text=The spring's growing energy");
    await page.waitForSelector("[data-ratio=forward_euler]");
    const y = 2 * Math.PI * 0.02;
    const forward = await shown("forward_euler", 100);
    const grown = (1 + y * y) ** forward.steps;
    assert.ok(Math.abs(forward.ratio / grown - 1) < 1e-6, `${forward.ratio}, expected ${grown}`);
    const symplectic = await shown("symplectic_euler", 100);
    assert.ok(symplectic.ratio > 0.8 && symplectic.ratio < 1.25, `${symplectic.ratio}`);
    // Beyond its limit the engine stops it, and the page says so.
    await page.click("text=Beyond the limit");
    await page.waitForFunction(() => /blew up/.test(document.querySelector("[data-scheme=symplectic_euler] .verdict")?.textContent ?? ""));
    assert.deepEqual(errors, []);
    await page.context().close();
  });
});
