/**
 * Scenes of the page of structures. One end is pinned, the other is held by a hand: springs of no rest length from its masses to pinned ones
 * that stand where the end should go. What is done to a structure is which of those places the springs lead to, so that it can be changed
 * while the world goes on, and stands in the scene.
 */

import type { Value } from "../engine/protocol";
import { FAMILIES, type Family } from "../links";
import { literal } from "../values";

export type Kind = "rope" | "sheet" | "block" | "net";

export type Deed = "shear" | "bend" | "twist" | "stretch";

export interface Choices {
  kind: Kind;
  /** Pieces along it; round the net. */
  fineness: number;
  on: Record<Family, boolean>;
  modulus: Record<Family, number>;
  /** All springs of the hand together [N/m]. */
  hand: number;
  deed: Deed | null;
}

interface Build {
  name: string;
  about: string;
  /** Families that it has; others would be refused. */
  families: Family[];
  modulus: Record<Family, number>;
  unit: string;
  /** Pieces: least, at the start, most, and what they are. */
  fineness: [number, number, number];
  pieces: string;
  hand: number;
  deeds: Deed[];
  /** How far it is bent and twisted [rad]; what is thin bends where its ends are pushed together. */
  bend: number;
  twist: number;
}

const LENGTH = 1.2;
/** Across: of the sheet, the block, the tube [m]. */
const WIDTH = 0.8;
const THICK = 0.3;
const ROUND = 0.22;
const RAD = Math.PI / 180;
const PUSH = 0.55;
/** Thin structures bend easily: softening factor of the springs. */
export const SOFT = 30;
const SHEAR = 28 * RAD;

export const BUILDS: Record<Kind, Build> = {
  rope: {
    name: "Rope",
    about: "A chain of masses. Its structural links resist only stretching; bend links, which skip one mass, keep it from folding.",
    families: ["structural", "bend"],
    modulus: { structural: 60, shear: 0, bend: 20 },
    unit: "N",
    fineness: [6, 16, 60],
    pieces: "Segments",
    hand: 40,
    deeds: ["bend", "stretch"],
    bend: 0,
    twist: 0,
  },
  sheet: {
    name: "Sheet",
    about: "A grid of masses. Without shear links each square is a hinged parallelogram; without bend links it folds freely.",
    families: ["structural", "shear", "bend"],
    modulus: { structural: 500, shear: 300, bend: 100 },
    unit: "N/m",
    fineness: [6, 14, 36],
    pieces: "Squares along its length",
    hand: 120,
    deeds: ["shear", "bend", "twist", "stretch"],
    bend: 0,
    twist: 110 * RAD,
  },
  block: {
    name: "Block",
    about:
      "A box of masses with the three families along and across its three axes. Structural links alone carry no shear: the diagonals make it a solid.",
    families: ["structural", "shear", "bend"],
    modulus: { structural: 3000, shear: 4000, bend: 1000 },
    unit: "Pa",
    fineness: [6, 9, 16],
    pieces: "Cubes along its length",
    hand: 200,
    deeds: ["shear", "bend", "twist", "stretch"],
    bend: 70 * RAD,
    twist: 90 * RAD,
  },
  net: {
    name: "Net",
    about:
      "A tube of triangles with a link along each edge. A triangle is rigid, so it resists shear without shear links; bend links cross each edge and keep the tube round.",
    families: ["structural", "bend"],
    modulus: { structural: 300, shear: 0, bend: 100 },
    unit: "N/m",
    fineness: [7, 12, 24],
    pieces: "Triangles around it",
    hand: 150,
    deeds: ["shear", "bend", "twist", "stretch"],
    bend: 70 * RAD,
    twist: 90 * RAD,
  },
};

export const start = (kind: Kind): Choices => {
  const b = BUILDS[kind];
  return {
    kind,
    fineness: b.fineness[1],
    on: { structural: true, shear: true, bend: true },
    modulus: { ...b.modulus },
    hand: b.hand,
    deed: null,
  };
};

type Point = [number, number, number];

interface Plan {
  /** Initial positions of its masses, x fastest, as the recipes of the engine order them. */
  points: Point[];
  /** Two rows of masses at either end: one would be a hinge. */
  pinned: number[];
  held: number[];
  resolution: number[];
  triangles: [number, number, number][];
}

const along = (i: number, n: number, length: number) => (n > 1 ? (i / (n - 1) - 0.5) * length : 0);

function plan({ kind, fineness: n }: Choices): Plan {
  if (kind === "net") return tube(n);
  const across = (width: number) => Math.max(Math.round((n * width) / LENGTH), 2) + 1;
  const resolution = kind === "rope" ? [n + 1, 1, 1] : kind === "sheet" ? [n + 1, across(WIDTH), 1] : [n + 1, across(THICK), across(THICK)];
  const size = [LENGTH, kind === "sheet" ? WIDTH : THICK, THICK];
  const points: Point[] = [];
  const ends: [number[], number[]] = [[], []];
  for (let k = 0; k < resolution[2]; k++)
    for (let j = 0; j < resolution[1]; j++)
      for (let i = 0; i <= n; i++) {
        if (i < 2) ends[0].push(points.length);
        if (i > n - 2) ends[1].push(points.length);
        points.push([along(i, n + 1, size[0]), along(j, resolution[1], size[1]), along(k, resolution[2], size[2])]);
      }
  return { points, pinned: ends[0], held: ends[1], resolution, triangles: [] };
}

/** A tube of triangles that are equilateral, or almost so. */
function tube(n: number): Plan {
  const side = 2 * ROUND * Math.sin(Math.PI / n);
  const rings = Math.max(Math.round(LENGTH / (0.866 * side)), 4) + 1;
  const points: Point[] = [];
  const triangles: Plan["triangles"] = [];
  for (let r = 0; r < rings; r++)
    for (let j = 0; j < n; j++) {
      const angle = (2 * Math.PI * (j + 0.5 * (r % 2))) / n;
      points.push([along(r, rings, LENGTH), ROUND * Math.cos(angle), ROUND * Math.sin(angle)]);
      if (r === 0) continue;
      const [a, b] = [(r - 1) * n, r * n];
      const next = (j + 1) % n;
      if (r % 2) triangles.push([a + j, a + next, b + j], [a + next, b + next, b + j]);
      else triangles.push([a + j, b + next, b + j], [a + j, a + next, b + next]);
    }
  const all = points.map((_, i) => i);
  return { points, triangles, resolution: [n, rings], pinned: all.filter((i) => i < 2 * n), held: all.filter((i) => i >= (rings - 2) * n) };
}

/** Target of a point of the end. */
function moved([x, y, z]: Point, deed: Deed, { bend, twist }: Build): Point {
  const half = 0.5 * LENGTH;
  if (deed === "stretch") return [x + 0.3 * LENGTH, y, z];
  // Along a circle, so that what lies along it keeps its length.
  if (deed === "shear") return [x - LENGTH * (1 - Math.cos(SHEAR)), y + LENGTH * Math.sin(SHEAR), z];
  if (deed === "twist") return [x, y * Math.cos(twist) - z * Math.sin(twist), y * Math.sin(twist) + z * Math.cos(twist)];
  // Towards its other end, and a little down: the rest leaves the straight line upwards.
  if (!bend) return [x - PUSH, y, z - 0.03];
  // As if all of it were bent to a circle.
  const r = LENGTH / bend - z;
  const angle = (bend * (x + half)) / LENGTH;
  return [-half + r * Math.sin(angle), y, LENGTH / bend - r * Math.cos(angle)];
}

/** All springs of the hand together, as they act [N/m]. */
export const strength = (c: Choices): number => (c.deed === null ? 0 : c.deed === "bend" && !BUILDS[c.kind].bend ? c.hand / SOFT : c.hand);

/** The springs of the hand, for a live change: to the places of a deed; without one they have no stiffness. */
export function springs(c: Choices): Value[] {
  const { held } = plan(c);
  const deeds = BUILDS[c.kind].deeds;
  const first = Math.max(deeds.indexOf(c.deed!), 0) * held.length;
  const stiffness = strength(c) / held.length;
  return held.map((row, k) => ({ name: `hand ${k}`, between: [`${c.kind} ${row}`, `places ${first + k}`], stiffness, rest_length: 0 }));
}

/** Rows that the hand holds, and where each started and should go. */
export function grip(c: Choices): { row: number; from: Point; to: Point | null }[] {
  const { held, points } = plan(c);
  return held.map((row) => ({ row, from: points[row], to: c.deed && moved(points[row], c.deed, BUILDS[c.kind]) }));
}

/** Families as the scene has them. One that is off keeps its links, without a force. */
export function links(c: Choices): Value {
  const families = FAMILIES.filter((f) => BUILDS[c.kind].families.includes(f));
  return Object.fromEntries(families.map((f) => [f, { modulus: c.on[f] ? c.modulus[f] : 0, damping: c.on[f] ? 0.004 * c.modulus[f] : 0 }]));
}

/** The mesh of the net, as an OBJ file. */
export const MESH = "tube.obj";
export function mesh(c: Choices): Uint8Array {
  const { points, triangles } = plan(c);
  const lines = [
    ...points.map((p) => `v ${p.map((v) => v.toFixed(7)).join(" ")}`),
    ...triangles.map((t) => `f ${t.map((i) => i + 1).join(" ")}`),
  ];
  return new TextEncoder().encode(`${lines.join("\n")}\n`);
}

export function scene(c: Choices): string {
  const b = BUILDS[c.kind];
  const { points, pinned, held, resolution } = plan(c);
  const node = (i: number) =>
    c.kind === "sheet"
      ? [i % resolution[0], Math.floor(i / resolution[0])]
      : c.kind === "block"
        ? [i % resolution[0], Math.floor(i / resolution[0]) % resolution[1], Math.floor(i / resolution[0] / resolution[1])]
        : [i];
  const pins = pinned.map((i) => `"vertex ${node(i).join(" ")}"`).join(", ");
  const numbers = (p: Point) => `[${p.map((v) => Number(v.toFixed(6))).join(", ")}]`;
  const shape = {
    rope: `from = ${numbers(points[0])}\nto = ${numbers(points[points.length - 1])}\nsegments = ${c.fineness}\ndensity = 0.3\nradius = 0.022`,
    sheet: `size = [${LENGTH}, ${WIDTH}]\nresolution = ${literal(resolution.slice(0, 2))}\ndensity = 0.3`,
    block: `size = [${LENGTH}, ${THICK}, ${THICK}]\nresolution = ${literal(resolution)}\ndensity = 8`,
    net: `mesh = { path = "${MESH}" }\ndensity = 0.3`,
  }[c.kind];
  return `version = 1
title = "A ${b.name.toLowerCase()} in the hand"

[time]
fps = 60
frames = 100_000_000

[world]
gravity = [0, 0, 0]

[[system]]
integrator = "implicit_euler"
substeps = 2

[[${c.kind}]]
name = "${c.kind}"
${shape}
links = ${literal(links(c))}
pin = [${pins}]

# Targets of the masses held by the hand: ${b.deeds.map((d) => `${held.length} to ${d}`).join(", ")}.
[[particles]]
name = "places"
position = [
${b.deeds.map((d) => `    ${held.map((i) => numbers(moved(points[i], d, b))).join(", ")},`).join("\n")}
]
pin = ["all"]
radius = 0.004

# Seen, not felt: what is pinned.
[[particles]]
name = "wall"
position = [${pinned.map((i) => numbers(points[i])).join(", ")}]
pin = ["all"]
radius = 0.011
color = [0.2, 0.21, 0.23]

${springs(c)
  .map(
    (s) =>
      `[[anchor]]\n${Object.entries(s as Record<string, Value>)
        .map(([k, v]) => `${k} = ${literal(v)}`)
        .join("\n")}\n`,
  )
  .join("\n")}
[[force]]
kind = "drag"
rate = 3

[camera]
position = [0.3, -3.2, 2.2]
target = [0, 0.05, 0.1]

[output]
columns = ["position", "link_strain"]
`;
}
