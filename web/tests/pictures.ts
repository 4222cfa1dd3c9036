/**
 * Pictures of the gallery: each scene by the app itself, at a frame that shows what it is about; and those of `public`, which others show of the
 * laboratory: `site`. `npm run pictures [ROW/NAME ...] [site]`
 */
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { lab, SCENES, shipped } from "./browser.ts";

/** Frame of the picture, where two thirds of the scene do not show it best. */
const AT: Record<string, number> = {
  "contact/bounce": 30,
  "drape/sheet-on-bunny": 40,
  "drape/sheet-on-ball": 40,
  "gas/bad_solver": 18,
  "gas/bunny": 50,
  "gas/fire": 45,
  "gas/plume": 60,
  "gas/obstacle": 50,
  "gas/flag_in_a_jet": 40,
  "gravity/galaxy": 40,
  "gravity/encounter": 80,
  "particles/waterfall": 70,
  "particles/fountain": 50,
  "cloth/dress": 50,
  "cloth/drapes": 40,
  "cloth/funnel": 50,
  "cloth/mannequin": 40,
  "cloth/torn-flag": 60,
  "cloth/twist": 60,
  "coupled/afloat": 14,
  "coupled/washing": 60,
  "grains/pour": 40,
  "rigid/rocks": 70,
  "rigid/shatter": 12,
  "coupled/cart": 14,
  "coupled/curtain": 14,
  "coupled/gust": 24,
  "coupled/sandbox": 20,
  "coupled/swing": 38,
  "coupled/trampoline": 20,
  "grains/clumps": 10,
  "grains/column": 22,
  "grains/heaps": 20,
  "grains/hopper": 30,
  "grains/hourglass": 30,
  "crowd/bottleneck": 200,
  "crowd/ceiling": 72,
  "crowd/office": 240,
  "crowd/school": 250,
  "integrators/overshoot": 5,
  "liquid/dam": 16,
  "liquid/bath": 8,
  "liquid/drop": 12,
  "liquid/honey": 24,
  "liquid/pour": 22,
  "liquid/raft": 18,
  "liquid/tension": 12,
  "liquid/waterwheel": 16,
  "liquid/wave-tank": 9,
  "rigid/arch": 18,
  "rigid/cradle": 12,
  "rigid/dominoes": 60,
  "rigid/machine": 30,
  "rigid/wall": 16,
  "rigid/wing-nut": 20,
  "rigid/wrecking-ball": 32,
  "springs/rusty": 28,
  "structures/blocks": 16,
  "structures/others": 40,
  "gas/vortex_street": 100,
};

/** Cameras, position and target, of scenes that are small in their own picture. */
const NEARER: Record<string, [number[], number[]]> = {
  "contact/slider": [
    [1.2, -2.6, 2.6],
    [1.2, 1.6, 0],
  ],
  "springs/rusty": [
    [0, -11, -5.1],
    [0, 0, -5.1],
  ],
};

/** Scenes of which pieces fly away. */
const LOOSE = ["cloth/torn-flag"];

const asked = process.argv.slice(2);
const ids = shipped().filter((id) => !asked.length || asked.includes(id));

mkdirSync("pictures", { recursive: true });
const own = await lab();
for (const id of ids) {
  const frames = Number(/^frames\s*=\s*(\d+)/m.exec(readFileSync(`${SCENES}/${id}.toml`, "utf8"))?.[1] ?? 120);
  const { page } = await own.open(`scene/${id}`, { viewport: { width: 1280, height: 800 }, reducedMotion: "reduce", colorScheme: "light" });
  try {
    await page.waitForFunction(() => document.getElementById("main")!.dataset.ready, null, { timeout: 120_000 });
    const data = await page.evaluate(
      async ({ at, nearer: sight, loose }) => {
        const { session, stage } = (window as any).tumble;
        if (sight) {
          stage.camera.position.set(...sight[0]);
          stage.controls.target.set(...sight[1]);
          stage.controls.update();
        }
        await session.goto(at).catch(() => {});
        stage.again();
        // From as near as shows all masses whole, and the bodies around which a tall picture is made. Of loose ones some few may be anywhere.
        const { camera, controls, home } = stage;
        const tall = !stage.flat && home.shape < 1.5;
        const point = controls.target.clone();
        const moved = point.clone();
        for (let [tries, nearer] = [0, tall]; tries < 40; tries++) {
          const edge = nearer ? 0.8 : 0.94;
          let whole = true;
          camera.updateMatrixWorld();
          for (const { name, form, topology, body } of stage.things) {
            const solid = form === "solid" || form === "container";
            const x = solid ? tall && topology.position?.data : session.shown.columns[name]?.position?.data;
            if (!x) continue;
            let outside = 0;
            for (let i = 0; i < x.length; i += 3) {
              point.set(x[i], x[i + 1], x[i + 2]);
              if (solid) point.applyMatrix4(body.object.matrixWorld);
              if (solid && moved.copy(point).sub(home.target).length() > home.width) continue;
              point.project(camera);
              if (Math.abs(point.x) > edge || Math.abs(point.y) > edge) outside++;
            }
            if (outside > (loose || (form === "points" && x.length > 90) ? 0.01 * x.length : 0)) whole = false;
          }
          if (whole && !nearer) break;
          if (!whole) nearer = false;
          stage.nudge(0, 0, nearer ? 1.05 : 1 / 1.05);
        }
        const blob: Blob = await stage.picture("image/png");
        const image = await createImageBitmap(blob);
        const small = new OffscreenCanvas(480, 270);
        const context = small.getContext("2d")!;
        context.imageSmoothingQuality = "high";
        const scale = Math.max(480 / image.width, 270 / image.height);
        context.drawImage(
          image,
          240 - 0.5 * scale * image.width,
          135 - 0.5 * scale * image.height,
          scale * image.width,
          scale * image.height,
        );
        const webp = await small.convertToBlob({ type: "image/webp", quality: 0.72 });
        return [...new Uint8Array(await webp.arrayBuffer())];
      },
      { at: AT[id] ?? Math.round((2 * frames) / 3), nearer: NEARER[id], loose: LOOSE.includes(id) },
    );
    writeFileSync(`pictures/${id.replace("/", "-")}.webp`, Uint8Array.from(data));
    console.log(id, data.length);
  } catch (error) {
    console.log(id, "FAILED", String(error).slice(0, 200));
  }
  await page.context().close();
}
if (!asked.length || asked.includes("site")) {
  const shot = await own.open("scene/particles/fountain", {
    viewport: { width: 1700, height: 1100 },
    reducedMotion: "reduce",
    colorScheme: "light",
  });
  await shot.page.waitForFunction(() => document.getElementById("main")!.dataset.ready, null, { timeout: 120_000 });
  const preview = await shot.page.evaluate(async () => {
    const { session, stage } = (window as any).tumble;
    await session.goto(50);
    stage.again();
    const image = await createImageBitmap(await stage.picture("image/png"));
    const whole = new OffscreenCanvas(1200, 630);
    const scale = Math.max(1200 / image.width, 630 / image.height);
    const [w, h] = [scale * image.width, scale * image.height];
    whole.getContext("2d")!.drawImage(image, 600 - w / 2, 315 - h / 2, w, h);
    const blob = await whole.convertToBlob({ type: "image/jpeg", quality: 0.82 });
    return [...new Uint8Array(await blob.arrayBuffer())];
  });
  writeFileSync("public/preview.jpg", Uint8Array.from(preview));
  for (const size of [192, 512]) {
    await shot.page.setViewportSize({ width: size, height: size });
    await shot.page.setContent(
      `<style>body { margin: 0 } svg { display: block; width: 100vw }</style>${readFileSync("public/icon.svg", "utf8")}`,
    );
    await shot.page.screenshot({ path: `public/icon-${size}.png` });
  }
  await shot.page.context().close();
}
await own.close();
