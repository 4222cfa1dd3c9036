/** Smoke veils what lies in it, and nothing that stands before it. */
import assert from "node:assert/strict";
import { after, before, it } from "node:test";
import { type Lab, lab } from "./browser.ts";

let own: Lab;
before(async () => {
  own = await lab();
});
after(() => own?.close());

// Smoke of one density fills a box of one metre; the nearest points of the bodies lie 3 cm and 77 cm behind its front.
const SCENE = {
  version: 1,
  gas: [{ name: "air", box: { size: [1, 1, 1], resolution: 16 }, smoke: { initial: "1", weight: 0 } }],
  particles: [
    {
      name: "balls",
      position: [
        [-0.3, -0.4, 0.25],
        [0.3, 0.34, 0.25],
      ],
      radius: 0.07,
      color: [1, 0.1, 0],
    },
  ],
  collider: [
    { name: "near", shape: { sphere: { center: [-0.3, -0.4, -0.25], radius: 0.07 } }, color: [1, 0.1, 0] },
    { name: "far", shape: { sphere: { center: [0.3, 0.34, -0.25], radius: 0.07 } }, color: [1, 0.1, 0] },
  ],
  output: { columns: ["density", "position"] },
  camera: { position: [0, -6, 0], target: [0, 0, 0], view_angle: 20 },
};

it("smoke veils what lies in it by as much as lies before it", async () => {
  const { page, errors } = await own.open("", { reducedMotion: "reduce" });
  await page.setInputFiles("#file", { name: "smoke.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(SCENE)) });
  await page.waitForFunction(() => document.getElementById("main")!.dataset.ready);
  const seen = await page.evaluate(async () => {
    const { stage } = (window as any).tumble;
    const { smoke } = stage.things.find((t: any) => t.body?.smoke).body;
    const places = [
      [-0.3, -0.47, 0.25],
      [0.3, 0.27, 0.25],
      [-0.3, -0.47, -0.25],
      [0.3, 0.27, -0.25],
    ];
    const out: number[][][] = [];
    for (const visible of [false, true]) {
      smoke.visible = visible;
      const image = await createImageBitmap(await stage.picture());
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d")!;
      context.drawImage(image, 0, 0);
      out.push(
        places.map((place) => {
          const p = smoke.position
            .clone()
            .set(...place)
            .project(stage.camera);
          return [...context.getImageData((0.5 + 0.5 * p.x) * image.width, (0.5 - 0.5 * p.y) * image.height, 1, 1).data.slice(0, 3)];
        }),
      );
    }
    return { bare: out[0], veiled: out[1] };
  });
  // By red less blue, of which smoke has none.
  const red = ([r, , b]: number[]) => r - b;
  const through = seen.veiled.map((color, k) => red(color) / red(seen.bare[k]));
  for (const color of seen.bare) assert.ok(red(color) > 100, `a body of colour ${color}`);
  // Half of the range of densities, 40 a metre: exp(-0.5 * 40 * 0.03).
  for (const k of [0, 2]) assert.ok(Math.abs(through[k] - 0.55) < 0.08, `${through[k]} is seen of what lies in front`);
  for (const k of [1, 3]) assert.ok(through[k] < 0.03, `${through[k]} is seen of what lies behind`);
  assert.deepEqual(errors, []);
  await page.context().close();
});

it("dye in a tank of water has a colour, smoke in air has none", async () => {
  const spread: number[] = [];
  for (const density of [1000, 1]) {
    const { page, errors } = await own.open("", { reducedMotion: "reduce" });
    const scene = {
      version: 1,
      gas: [{ name: "tank", box: { size: [1, 1, 1], resolution: 12 }, fluid_density: density, smoke: { initial: "1", weight: 0 } }],
      camera: { position: [0, -6, 0], target: [0, 0, 0], view_angle: 20 },
    };
    await page.setInputFiles("#file", { name: "tank.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(scene)) });
    await page.waitForFunction(() => document.getElementById("main")!.dataset.ready);
    const color = await page.evaluate(async () => {
      const image = await createImageBitmap(await (window as any).tumble.stage.picture());
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d")!;
      context.drawImage(image, 0, 0);
      return [...context.getImageData(image.width / 2, image.height / 2, 1, 1).data.slice(0, 3)];
    });
    spread.push(Math.max(...color) - Math.min(...color));
    assert.deepEqual(errors, []);
    await page.context().close();
  }
  assert.ok(spread[0] > 40 && spread[1] < 25, `red, green and blue differ by ${spread}`);
});
