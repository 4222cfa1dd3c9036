/** Values of scenes, as TOML writes them and where they stand. */
import { parse, stringify } from "smol-toml";
import type { Value } from "./engine/protocol";

/** A value as TOML writes it; what is not set in a table is left out. */
export function literal(value: Value): string {
  if (typeof value === "string") return JSON.stringify(value);
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  if (typeof value === "object")
    return `{ ${Object.entries(value)
      .filter(([, v]) => v !== null)
      .map(([k, v]) => `${/^[\w-]+$/.test(k) ? k : JSON.stringify(k)} = ${literal(v)}`)
      .join(", ")} }`;
  return String(value);
}

/** The right side of an "=": TOML, or a bare word. */
export function valueIn(text: string): Value {
  try {
    return parse(`x = ${text}`).x as Value;
  } catch {
    return text.trim();
  }
}

/** Value in a resolved scene at a path such as "sheet.flag.size" or "system.0.substeps"; null if there is none. */
export function valueAt(scene: unknown, path: string): Value | null {
  let at: unknown = scene;
  for (const key of path.split(".")) {
    if (Array.isArray(at))
      at = /^\d+$/.test(key) ? at[Number(key)] : at.find((entry) => (entry as { name?: unknown } | null)?.name === key);
    else if (at && typeof at === "object" && Object.hasOwn(at, key)) at = (at as Record<string, unknown>)[key];
    else return null;
  }
  return (at ?? null) as Value | null;
}

/** Paths of the mesh files that a resolved scene names, with the hash of their content beside. */
export function meshesOf(node: unknown): string[] {
  if (!node || typeof node !== "object") return [];
  const { path, hash } = node as { path?: unknown; hash?: unknown };
  const own = typeof path === "string" && typeof hash === "string" ? [path] : [];
  return [...new Set([...own, ...Object.values(node).flatMap(meshesOf)])];
}

/** Whether two trees hold the same, in whatever order. */
export function alike(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (!a || !b || typeof a !== "object" || typeof b !== "object" || Array.isArray(a) !== Array.isArray(b)) return false;
  const [p, q] = [a, b] as Record<string, unknown>[];
  const keys = Object.keys(p);
  return keys.length === Object.keys(q).length && keys.every((key) => Object.hasOwn(q, key) && alike(p[key], q[key]));
}

/** A resolved scene as text. TOML has no word for nothing: what is not set is left out. */
export function written(scene: Record<string, unknown>): string {
  const whole = (node: unknown): unknown =>
    Array.isArray(node)
      ? node.map(whole)
      : node && typeof node === "object"
        ? Object.fromEntries(
            Object.entries(node)
              .filter(([, v]) => v !== null)
              .map(([k, v]) => [k, whole(v)]),
          )
        : node;
  return stringify(whole(scene) as Record<string, unknown>);
}
