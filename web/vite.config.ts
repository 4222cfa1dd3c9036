import { readdirSync, readFileSync } from "node:fs";
import { join, relative, resolve } from "node:path";
import { defineConfig, type Plugin } from "vite";

const root = resolve(import.meta.dirname, "..");

/** Which source files cite which equation: `import sources from "virtual:sources"` is { "gas.4": ["crates/..."] }. */
function sources(): Plugin {
  const name = "virtual:sources";
  return {
    name: "sources",
    resolveId: (id) => (id === name ? "\0" + name : undefined),
    load(id) {
      if (id !== "\0" + name) return;
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

export default defineConfig({
  // Relative, so that the folder can be put anywhere on any host.
  base: "./",
  plugins: [sources()],
  worker: { format: "es" },
  build: { target: "es2022", chunkSizeWarningLimit: 900 },
  server: { fs: { allow: [root] } },
});
