import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join, relative, resolve } from "node:path";
import { parse } from "smol-toml";
import { defineConfig, type Plugin } from "vite";

const root = resolve(import.meta.dirname, "..");

/** Which source files cite which equation: `import sources from "virtual:sources"` is { "gas.4": ["crates/..."] }. */
function sources(): Plugin {
  const name = "virtual:sources";
  return {
    name: "sources",
    resolveId: (id) => (id === name ? `\0${name}` : undefined),
    load(id) {
      if (id !== `\0${name}`) return;
      const found: Record<string, string[]> = {};
      const folder = join(root, "crates/tumble/src");
      for (const entry of readdirSync(folder, { recursive: true, withFileTypes: true })) {
        if (!entry.name.endsWith(".rs")) continue;
        const path = join(entry.parentPath, entry.name);
        for (const [, tag] of readFileSync(path, "utf8").matchAll(/\(([a-z]+\.\d+)\)/g)) {
          const files = (found[tag] ??= []);
          const short = relative(root, path);
          if (!files.includes(short)) files.push(short);
        }
      }
      return `export default ${JSON.stringify(found)};`;
    },
  };
}

/** Title and precision of each scene, without its text: `import scenes from "virtual:scenes"` is { "gas/fire": { title: "...", ... } }. */
function scenes(): Plugin {
  const name = "virtual:scenes";
  return {
    name: "scenes",
    resolveId: (id) => (id === name ? `\0${name}` : undefined),
    load(id) {
      if (id !== `\0${name}`) return;
      const folder = join(root, "python/tumble/scenes");
      const found = readdirSync(folder, { recursive: true, encoding: "utf8" })
        .filter((path) => path.endsWith(".toml"))
        .map((path) => {
          this.addWatchFile(join(folder, path));
          const { title = "", precision = "single" } = parse(readFileSync(join(folder, path), "utf8"));
          return [path.slice(0, -5).replaceAll("\\", "/"), { title, precision }];
        });
      return `export default ${JSON.stringify(Object.fromEntries(found))};`;
    },
  };
}

/** Version of the engine, which is that of the laboratory. */
const version = /^version = "([^"]+)"/m.exec(readFileSync(join(root, "Cargo.toml"), "utf8"))![1];

/** Address at which the site will be, if it is known. */
const host = process.env.TUMBLE_SITE;

/**
 * Each version lies in a folder of its own, `dist/v/VERSION/`, where links that it wrote lead; what is beside it stays. The first page of
 * the site takes everything from there, and what is not found is told by a page of its own.
 */
function site(): Plugin {
  return {
    name: "site",
    apply: "build",
    // Those who show a preview of a link want the whole address of its picture.
    transformIndexHtml: (html) => html.replace("PREVIEW", `${host ? `${host.replace(/\/$/, "")}/v/${version}/` : "./"}preview.jpg`),
    writeBundle({ dir }) {
      const first = readFileSync(join(dir!, "index.html"), "utf8");
      const dist = resolve(dir!, "../..");
      writeFileSync(join(dist, "index.html"), first.replaceAll('="./', `="./v/${version}/`));
      const lost = readFileSync(join(import.meta.dirname, "404.html"), "utf8").replace('"VERSION"', JSON.stringify(version));
      const script = /<script>([\s\S]*)<\/script>/.exec(lost)![1];
      writeFileSync(join(dist, "404.html"), lost.replace("SCRIPT", `sha256-${createHash("sha256").update(script).digest("base64")}`));
    },
  };
}

export default defineConfig({
  // Relative, so that the folder can be put anywhere on any host.
  base: "./",
  plugins: [sources(), scenes(), site()],
  worker: { format: "es" },
  build: { outDir: `dist/v/${version}`, target: "es2022", chunkSizeWarningLimit: 900 },
  server: { fs: { allow: [root] } },
});
