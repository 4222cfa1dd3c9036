/** Families of links: which there are, which link belongs to which, and how a scene goes on without one. */
import type { Column, ObjectInfo, SceneInfo, Value } from "./engine/protocol";

export const FAMILIES = ["structural", "shear", "bend"] as const;
export type Family = (typeof FAMILIES)[number];

/** Resistance of each family, after docs/theory/structures.md. */
export const RESISTS: Record<Family, string> = {
  structural: "links connect neighbours and resist stretching.",
  shear: "links run along diagonals and resist shear, which the others do not.",
  bend: "links skip a mass, or cross a triangle edge, and weakly resist folding.",
};

type Settings = Record<string, Value | null>;
type Entry = Record<string, any>;

/** An object with families of links. */
export interface Linked {
  name: string;
  /** Path of its links: "sheet.0.links". */
  path: string;
  /** The families that it has, with all their settings. */
  families: Partial<Record<Family, Settings>>;
  diagonals: Value;
  /** A clamp keeps links short whatever their stiffness is, so that a family that is off must not be there at all. */
  clamped: boolean;
}

const KINDS = ["rope", "sheet", "block", "net"];

function entryOf(info: SceneInfo, object: ObjectInfo): [Entry, number] | null {
  const list = info.scene[object.kind];
  const index = Array.isArray(list) ? list.findIndex((e: Entry) => e.name === object.name) : -1;
  return index < 0 ? null : [(list as Entry[])[index], index];
}

/** The objects that have families of links, in the order of the scene. */
export function linked(info: SceneInfo): Linked[] {
  return info.objects.flatMap((object) => {
    if (!KINDS.includes(object.kind)) return [];
    const [entry, index] = entryOf(info, object) ?? [];
    if (!entry || entry.rod || entry.material) return [];
    const links: Entry = entry.links ?? {};
    const families = Object.fromEntries(
      FAMILIES.flatMap((f) =>
        links[f] === null || links[f] === undefined
          ? []
          : [[f, (typeof links[f] === "number" ? { modulus: links[f] } : links[f]) as Settings]],
      ),
    );
    const systems = (info.scene.system ?? []) as Entry[];
    return [
      {
        name: object.name,
        path: `${object.kind}.${index}.links`,
        families,
        diagonals: links.diagonals ?? "both",
        clamped: systems.some((s) => s.name === object.system && s.clamp),
      },
    ];
  });
}

export const isOn = (settings: Settings | undefined): boolean =>
  !!settings && (Number(settings.modulus) > 0 || Number(settings.damping ?? 0) > 0);

/** All links of an object, as its scene should have them, with other settings of one family; `null` takes it away. */
export function changed({ families, diagonals, clamped }: Linked, family: Family, settings: Settings | null): Value {
  const all: Entry = { ...families, [family]: settings ?? (clamped ? undefined : { ...families[family], modulus: 0, damping: 0 }) };
  // Links without a force keep their places in the state: a broken one stays broken.
  const table: Entry = { diagonals };
  for (const [name, own] of Object.entries(all))
    if (own) table[name] = Object.fromEntries(Object.entries(own as Entry).filter(([, v]) => v !== null));
  return table;
}

/** The family of each link of an object, as an index into `FAMILIES`; null where its links have none. */
export function familiesOf(info: SceneInfo, object: ObjectInfo): Uint8Array | null {
  const topology = info.topology[object.name] ?? {};
  const [entry] = (KINDS.includes(object.kind) && entryOf(info, object)) || [];
  if (!entry || !topology.links) return null;
  const pairs = topology.links.data;
  const out = new Uint8Array(pairs.length / 2);
  const between =
    object.kind === "net"
      ? onEdges(topology.triangles, !entry.links?.structural)
      : onLattice(object.kind === "rope" ? [entry.segments + 1] : entry.resolution);
  for (let i = 0; i < out.length; i++) out[i] = between(pairs[2 * i], pairs[2 * i + 1]);
  return out;
}

/** Masses count with the first direction fastest: the way from one to the other says what links them. */
function onLattice(resolution: number[]): (a: number, b: number) => number {
  return (a, b) => {
    let [directions, farthest] = [0, 0];
    for (const n of resolution) {
      const way = Math.abs((a % n) - (b % n));
      if (way) directions++;
      farthest = Math.max(farthest, way);
      [a, b] = [Math.floor(a / n), Math.floor(b / n)];
    }
    return directions > 1 ? 1 : farthest > 1 ? 2 : 0;
  };
}

/** Structural links lie on edges of triangles; bend links lead across them. */
function onEdges(triangles: Column | undefined, bendAlone: boolean): (a: number, b: number) => number {
  const key = (a: number, b: number) => Math.min(a, b) * 2 ** 26 + Math.max(a, b);
  const edges = new Set<number>();
  const t = triangles?.data ?? [];
  for (let i = 0; i + 2 < t.length && !bendAlone; i += 3)
    for (const [j, k] of [
      [0, 1],
      [1, 2],
      [2, 0],
    ])
      edges.add(key(t[i + j], t[i + k]));
  return (a, b) => (edges.has(key(a, b)) ? 0 : 2);
}
