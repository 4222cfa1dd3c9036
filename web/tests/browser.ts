/** Debian's Chromium and the built folder, for tests and pictures. */
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { type Browser, type BrowserContextOptions, chromium, type Page } from "playwright-core";
import { type PreviewServer, preview } from "vite";

/** The browser, if there is one. */
export const CHROMIUM = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(
  (p) => p && existsSync(p),
);

export interface Lab {
  address: string;
  browser: Browser;
  /** A page whose errors are collected. */
  open(path: string, options?: BrowserContextOptions): Promise<{ page: Page; errors: string[] }>;
  close(): Promise<void>;
}

export async function lab(): Promise<Lab> {
  if (!CHROMIUM) throw new Error("no Chromium here: apt-get install chromium, or set CHROMIUM to one");
  const outDir = process.env.DIST ?? "dist";
  if (!existsSync(`${outDir}/index.html`)) throw new Error("nothing is built: make web");
  const server: PreviewServer = await preview({ build: { outDir }, preview: { port: 0, host: "127.0.0.1" }, logLevel: "error" });
  const address = server.resolvedUrls!.local[0];
  const browser = await chromium.launch({
    executablePath: CHROMIUM,
    headless: true,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  return {
    address,
    browser,
    async open(path, options = {}) {
      const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
      // Machines that do other things, too, are slow; nothing here waits longer than it must.
      context.setDefaultTimeout(90_000);
      const page = await context.newPage();
      const errors: string[] = [];
      page.on("pageerror", (e) => errors.push(String(e)));
      page.on("console", (m) => {
        // Messages of software rendering are not our errors.
        if (m.type() === "error" && !/GPU stall|GL Driver|WebGL-0x/.test(m.text())) errors.push(m.text());
      });
      await page.goto(`${address}#/${path}`);
      return { page, errors };
    },
    async close() {
      await browser.close();
      await server.close();
    },
  };
}

/** Folder of the scenes, and all bundled ones, as ROW/NAME. */
export const SCENES = "../python/tumble/scenes";
export const shipped = (): string[] =>
  readdirSync(SCENES, { withFileTypes: true })
    .filter((row) => row.isDirectory() && row.name !== "assets")
    .flatMap((row) =>
      readdirSync(`${SCENES}/${row.name}`)
        .filter((f) => f.endsWith(".toml"))
        .map((f) => `${row.name}/${f.slice(0, -5)}`),
    )
    .sort();

/** All that is promised, as in `make validate`, and not the part of it that `make test` has time for. */
export const WHOLE = !!process.env.TUMBLE_WHOLE;

/** Scenes that take some seconds to be made and to take a step: strands, fabrics and galaxies of full size are tried in `make validate`. */
const HEAVY = [
  "cloth/drapes",
  "cloth/dress",
  "cloth/hair-on-bunny",
  "gas/bunny",
  "gas/vortex_street",
  "gravity/encounter",
  "gravity/galaxy",
];

/** All bundled scenes, or in `make test` every third of those that are not heavy, from the first or from the second. */
export function tried(first: 0 | 1): string[] {
  const all = shipped();
  const missing = HEAVY.filter((id) => !all.includes(id));
  if (missing.length) throw new Error(`no such scenes: ${missing}`);
  if (WHOLE) return all;
  return all.filter((id) => !HEAVY.includes(id)).filter((_, k) => k % 3 === first);
}

/** Options of pages that play nothing by themselves. */
export const STILL = { reducedMotion: "reduce" } as const;

/** Waits until a page has its world, or has failed to get it. */
export const ready = (page: Page) => page.waitForFunction(() => document.getElementById("main")!.dataset.ready);

/** Serious findings of axe-core. The page must have been opened with `bypassCSP`. */
export async function serious(page: Page, only?: string[]): Promise<string[]> {
  await page.evaluate(readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8"));
  return page.evaluate(async (only) => {
    const options = { resultTypes: ["violations"], ...(only ? { runOnly: only } : {}) };
    const { violations } = await (window as any).axe.run(document, options);
    const bad = violations.filter((v: any) => ["serious", "critical"].includes(v.impact));
    return bad.map(
      (v: any) =>
        `${v.id}: ${v.nodes
          .slice(0, 3)
          .map((n: any) => `${n.target.join(" ")} ${n.any[0]?.message ?? ""}`)
          .join("; ")}`,
    );
  }, only);
}

/** Waits until the scene page shows a frame at or after this one. */
export async function frame(page: Page, index: number, timeout = 90_000): Promise<void> {
  await page.waitForFunction((i) => Number(document.getElementById("main")!.dataset.frame ?? -1) >= i, index, { timeout });
}
