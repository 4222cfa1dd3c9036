/** Pictures of the gallery: each scene by the app itself, at a frame that shows what it is about. `npm run pictures [ROW/NAME ...]` */
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { lab, SCENES, shipped } from "./browser.ts";

/** Frame of the picture, where two thirds of the scene do not show it best. */
const AT: Record<string, number> = {
  "contact/bounce": 30,
  "drape/sheet-on-bunny": 40,
  "drape/sheet-on-ball": 40,
  "failures/stiff-sheet": 8,
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
  "integrators/overshoot": 5,
  "springs/rusty": 33,
  "structures/blocks": 16,
  "structures/others": 40,
  "gas/vortex_street": 100,
};

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
      async (at) => {
        const { session, stage } = (window as any).tumble;
        await session.goto(at).catch(() => {});
        stage.again();
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
      AT[id] ?? Math.round((2 * frames) / 3),
    );
    writeFileSync(`pictures/${id.replace("/", "-")}.webp`, Uint8Array.from(data));
    console.log(id, data.length);
  } catch (error) {
    console.log(id, "FAILED", String(error).slice(0, 200));
  }
  await page.context().close();
}
await own.close();
