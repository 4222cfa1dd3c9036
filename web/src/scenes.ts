/** The scenes that ship with tumble, from the one place where they live, and the pages of theory. */
import index from "virtual:scenes";
import { root } from "./share";

const texts = import.meta.glob("../../python/tumble/scenes/*/*.toml", { query: "?raw", import: "default" }) as Record<
  string,
  () => Promise<string>
>;
const assets = import.meta.glob("../../python/tumble/scenes/assets/*.{ply,obj,stl,glb}", {
  query: "?url",
  import: "default",
  eager: true,
}) as Record<string, string>;
const pictures = import.meta.glob("../pictures/*.webp", { query: "?url&no-inline", import: "default", eager: true }) as Record<
  string,
  string
>;
const pages = import.meta.glob("../../docs/theory/*.md", { query: "?raw", import: "default" }) as Record<string, () => Promise<string>>;

export interface Shipped {
  /** ROW/NAME, as on the command line. */
  id: string;
  row: string;
  name: string;
  title: string;
  precision: "single" | "double";
  picture: string | null;
  text: () => Promise<string>;
}

const idOf = (path: string) =>
  path
    .split("/")
    .slice(-2)
    .join("/")
    .replace(/\.toml$/, "");

/** Titles of the rows, in the order in which a newcomer would look. */
const ROWS: Record<string, string> = {
  cloth: "Cloth and hair",
  drape: "Draped sheets",
  rigid: "Rigid bodies",
  grains: "Sand and grains",
  crowd: "Crowds",
  coupled: "Everything with everything",
  springs: "Springs",
  structures: "Structures",
  integrators: "Integrators",
  contact: "Contact",
  particles: "Particles",
  gravity: "Gravity",
  gas: "Gas and smoke",
  liquid: "Water",
  heat: "Heat",
  failures: "Failures",
};

export const rowTitle = (row: string): string => ROWS[row] ?? row;

export const SCENES: Shipped[] = Object.entries(texts)
  .map(([path, text]) => {
    const id = idOf(path);
    const [row, name] = id.split("/");
    return { id, row, name, ...index[id], text, picture: pictures[`../pictures/${row}-${name}.webp`] ?? null };
  })
  .sort((a, b) => order(a.row) - order(b.row) || a.name.localeCompare(b.name));

function order(row: string): number {
  const rows = Object.keys(ROWS);
  return rows.includes(row) ? rows.indexOf(row) : rows.length;
}

/** Scenes to go on to from another: those of its row; what flies by itself and what gravitation holds are one. */
export function beside(id: string): Shipped[] {
  const kin = (row: string) => (row === "gravity" ? "particles" : row);
  const own = sceneOf(id);
  return own ? SCENES.filter((s) => kin(s.row) === kin(own.row)) : [];
}

export const sceneOf = (id: string): Shipped | undefined => SCENES.find((s) => s.id === id);

/** Title of a scene without reading all of it. */
export const titleOf = (text: string): string => /^title\s*=\s*"((?:[^"\\]|\\.)*)"/m.exec(text)?.[1].replace(/\\"/g, '"') ?? "";

/** A mesh of the scene that `tumble view` serves beside the page. */
export async function viewed(path: string): Promise<Uint8Array | null> {
  if (!new URLSearchParams(location.search).has("view")) return null;
  const answer = await fetch(`${root()}view/${encodeURIComponent(path)}`).catch(() => null);
  return answer?.ok ? new Uint8Array(await answer.arrayBuffer()) : null;
}

/** A mesh that ships with tumble. */
export async function shipped(path: string): Promise<Uint8Array | null> {
  const name = path.split("/").pop()!;
  const url = Object.entries(assets).find(([key]) => key.endsWith(`/${name}`))?.[1];
  if (!url) return null;
  const answer = await fetch(url);
  return answer.ok ? new Uint8Array(await answer.arrayBuffer()) : null;
}

export const theoryNames = Object.keys(pages).map((path) => path.split("/").pop()!.replace(".md", ""));

export async function theoryText(name: string): Promise<string | null> {
  const page = pages[`../../docs/theory/${name}.md`];
  return page ? page() : null;
}
