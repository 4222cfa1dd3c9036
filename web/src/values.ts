/** Values of scenes, as TOML writes them and where they stand. */
import type { Value } from "./engine/protocol";

/** A value as TOML writes it; what is not set in a table is left out. */
export function literal(value: Value): string {
  if (typeof value === "string") return JSON.stringify(value);
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  if (typeof value === "object") return `{ ${Object.entries(value).filter(([, v]) => v !== null).map(([k, v]) => `${/^[\w-]+$/.test(k) ? k : JSON.stringify(k)} = ${literal(v)}`).join(", ")} }`;
  return String(value);
}

/** What stands in a resolved scene at a path such as "sheet.flag.size" or "system.0.substeps"; null where nothing does. */
export function valueAt(scene: unknown, path: string): Value | null {
  let at: unknown = scene;
  for (const key of path.split(".")) {
    if (Array.isArray(at)) at = /^\d+$/.test(key) ? at[Number(key)] : at.find((entry) => (entry as { name?: unknown } | null)?.name === key);
    else if (at && typeof at === "object" && Object.hasOwn(at, key)) at = (at as Record<string, unknown>)[key];
    else return null;
  }
  return (at ?? null) as Value | null;
}
