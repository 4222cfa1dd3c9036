/** A scene's camera that moves is followed until somebody turns the picture, and again when asked. */
import assert from "node:assert/strict";
import { after, before, it } from "node:test";
import type { Page } from "playwright-core";
import { type Lab, lab, ready, STILL } from "./browser.ts";

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

const BALL = [0.2, 0, 0.4];
const RATE = 10;
const SCENE = {
  version: 1,
  time: { fps: RATE, frames: 20 },
  world: { gravity: [0, 0, 0] },
  particles: [{ name: "p", position: [BALL], radius: 0.08 }],
  camera: {
    // Narrower than any window here, so that the height is all of the picture's.
    resolution: [300, 900],
    position: {
      keys: [
        [0, 0, -4, 0.5],
        [2, 1, -6, 0.5],
      ],
    },
    target: ["0.1*t", 0, 0.5],
    view_angle: "20 - 5*t",
  },
};

/** Where the ball is in the window, -1 to 1, by the words alone, at a time and in a window of this shape. */
const pinhole = (t: number, aspect: number) => {
  const [x, y] = [0.5 * t - 0.1 * t, -4 - t];
  const far = Math.hypot(x, y);
  const way = [BALL[0] - 0.5 * t, 4 + t];
  const depth = (-x * way[0] - y * way[1]) / far;
  const right = (-y * way[0] + x * way[1]) / far;
  const tall = 3 * Math.tan(((20 - 5 * t) * Math.PI) / 360) * depth;
  return [right / (tall * aspect), (BALL[2] - 0.5) / tall];
};

const seen = (page: Page): Promise<{ place: number[]; aspect: number; time: number }> =>
  page.evaluate((ball) => {
    const { stage, session } = (window as any).tumble;
    stage.render();
    const p = stage.camera.position
      .clone()
      .set(...ball)
      .project(stage.camera);
    return { place: [p.x, p.y], aspect: stage.camera.aspect, time: session.shown.time };
  }, BALL);

const go = (page: Page, index: number) => page.evaluate((i) => (window as any).tumble.session.goto(i), index);

const near = (a: number[], b: number[], tolerance: number) => a.every((x, i) => Math.abs(x - b[i]) < tolerance);

it("follows the camera of the scene, is turned away, and comes back", async () => {
  const { page, errors } = await own.open("", STILL);
  await page.setInputFiles("#file", { name: "shot.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(SCENE)) });
  await ready(page);
  const places: number[][] = [];
  // At both keys, half-way between them, and back again.
  for (const index of [0, 10, 20, 5]) {
    await go(page, index);
    const { place, aspect, time } = await seen(page);
    assert.ok(Math.abs(time - index / RATE) < 1e-6);
    const meant = pinhole(time, aspect);
    assert.ok(near(place, meant, 1e-4), `frame ${index}: ${place}, meant ${meant}`);
    places.push(place);
  }
  assert.ok(!near(places[0], places[1], 0.02) && !near(places[1], places[2], 0.02));
  // A click turns nothing; a drag does, and then the view is the user's.
  await page.mouse.click(400, 300);
  await go(page, 6);
  assert.ok(near((await seen(page)).place, pinhole(0.6, (await seen(page)).aspect), 1e-4));
  const box = (await page.locator(".stage canvas").boundingBox())!;
  const [x, y] = [box.x + 0.15 * box.width, box.y + 0.2 * box.height];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y + 20, { steps: 4 });
  await page.mouse.up();
  const turned = (await seen(page)).place;
  for (const index of [12, 18]) {
    await go(page, index);
    const now = await seen(page);
    assert.ok(near(now.place, turned, 1e-6), `frame ${index} moved the view that somebody has turned`);
    assert.ok(!near(now.place, pinhole(now.time, now.aspect), 0.01));
  }
  await page.click('[aria-label="Reset to the scene\'s camera"], [title="Reset to the scene\'s camera"]');
  for (const index of [18, 3]) {
    await go(page, index);
    const now = await seen(page);
    assert.ok(near(now.place, pinhole(now.time, now.aspect), 1e-4), `frame ${index} after the way back`);
  }
  assert.deepEqual(errors, []);
  await page.context().close();
});

it("tells what is wrong with it", async () => {
  const { page } = await own.open("", STILL);
  const scene = { ...SCENE, camera: { position: "[0, t - 1, 0]", target: [0, 0, 0] } };
  await page.setInputFiles("#file", { name: "shot.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(scene)) });
  await page.waitForFunction(() => /which is the target, too/.test(document.body.textContent ?? ""));
  await page.context().close();
});
