/** The theory beside each page: equations by their tags, where they are explained, and the files that implement them. */
import sources from "virtual:sources";
import { h } from "./dom";
import { METHODS } from "./engine/measures";
import type { SceneInfo } from "./engine/protocol";
import { theoryText } from "./scenes";

interface Topic {
  page: string;
  tags: string[];
}

/** Integrators, and the equations of docs/theory/integrators.md that they are. */
export const SCHEMES: Record<string, string> = {
  forward_euler: "1",
  symplectic_euler: "2",
  modified_euler: "3",
  midpoint: "5",
  heun: "5",
  rk4: "5",
  verlet: "6",
  velocity_verlet: "7",
  adaptive_euler: "8",
  dormand_prince: "9",
  implicit_euler: "10",
  implicit_midpoint: "11",
  bdf2: "12",
};

const FORCES: Record<string, Topic> = {
  attraction: { page: "orbits", tags: ["orbits.1", "orbits.2"] },
  gravitation: { page: "orbits", tags: ["orbits.11"] },
  flock: { page: "flocks", tags: ["flocks.1", "flocks.3"] },
  drag: { page: "particles", tags: ["particles.3"] },
  wind: { page: "particles", tags: ["particles.4"] },
  vortex: { page: "particles", tags: ["particles.6"] },
  propulsion: { page: "particles", tags: ["particles.7"] },
  magnetic: { page: "particles", tags: ["particles.8"] },
  electric: { page: "particles", tags: ["particles.9"] },
  turbulence: { page: "particles", tags: ["particles.10"] },
  acceleration: { page: "particles", tags: ["particles.1"] },
  formula: { page: "particles", tags: ["particles.1"] },
  lennard_jones: { page: "neighbours", tags: ["neighbours.5"] },
  repulsion: { page: "neighbours", tags: ["neighbours.7"] },
  cohesion: { page: "neighbours", tags: ["neighbours.8"] },
  viscosity: { page: "neighbours", tags: ["neighbours.9"] },
};

/** Topics of a scene, the most specific first. */
export function topics(info: SceneInfo): Topic[] {
  const found: Topic[] = [];
  const scene = info.scene as Record<string, any>;
  const has = (kind: string) => info.objects.some((o) => o.kind === kind);
  for (const { method } of info.systems) for (const [page, tags] of METHODS[method].theory) found.push({ page, tags });
  if ((scene.gas ?? []).some((g: any) => g.fire)) found.push({ page: "fire", tags: ["fire.1"] });
  if ((scene.body ?? []).some((b: any) => b.fracture)) found.push({ page: "fracture", tags: ["fracture.1"] });
  if (has("joint")) found.push({ page: "joints", tags: ["joints.1", "joints.2"] });
  for (const force of [...(scene.force ?? []), ...(scene.field ?? [])])
    if (FORCES[force.kind] && force.kind !== "drag") found.push(FORCES[force.kind]);
  if ((scene.rope ?? []).some((r: any) => r.rod)) found.push({ page: "rods", tags: ["rods.1"] });
  if ((scene.block ?? []).some((b: any) => b.material)) found.push({ page: "solids", tags: ["solids.1", "solids.4"] });
  if (
    ["sheet", "block", "net"].some(has) ||
    (scene.rope ?? []).some((r: any) => !r.rod) ||
    (scene.particles ?? []).some((p: any) => p.spring?.length)
  )
    found.push({ page: "springs", tags: ["springs.1", "springs.2"] });
  if (has("collider") && !has("gas")) found.push({ page: "contact", tags: ["contact.1"] });
  // Almost every scene has some drag; none is about it.
  if ((scene.force ?? []).some((f: any) => f.kind === "drag")) found.push(FORCES.drag);
  if (has("emitter")) found.push({ page: "particles", tags: ["particles.2"] });
  const schemes = [...new Set(info.systems.filter((s) => METHODS[s.method].stepped).map((s) => s.integrator))];
  if (schemes.length) found.push({ page: "integrators", tags: schemes.map((s) => `integrators.${SCHEMES[s] ?? "1"}`) });
  const pages = new Map<string, Topic>();
  for (const t of found) {
    const old = pages.get(t.page);
    if (old) old.tags = [...new Set([...old.tags, ...t.tags])];
    else pages.set(t.page, { page: t.page, tags: [...t.tags] });
  }
  return [...pages.values()];
}

/** The lines of an equation: its own, and those before it that belong to it. */
export function equation(text: string, tag: string): string | null {
  for (const [, block] of text.matchAll(/```text\n([\s\S]*?)```/g)) {
    const lines = block.split("\n");
    const end = lines.findIndex((l) => l.includes(`(${tag})`));
    if (end < 0) continue;
    let start = end;
    while (start > 0 && lines[start - 1].trim() && !/\([a-z]+\.\d+\)\s*$/.test(lines[start - 1])) start--;
    return lines
      .slice(start, end + 1)
      .map((l) => l.replace(/\s+(\([a-z]+\.\d+\))\s*$/, "    $1"))
      .join("\n")
      .trim();
  }
  return null;
}

export const question = (text: string): string => /^\*(.+?)\*$/ms.exec(text)?.[1].replace(/\s+/g, " ") ?? "";
export const heading = (text: string): string => /^#\s+(.+)$/m.exec(text)?.[1] ?? "";

/** Cards of the topics. */
export async function cards(list: Topic[]): Promise<HTMLElement[]> {
  const made = await Promise.all(
    list.map(async ({ page, tags }) => {
      const text = await theoryText(page);
      if (!text) return null;
      const known = tags.length
        ? tags
        : [...text.matchAll(/\(([a-z]+\.\d+)\)\s*$/gm)]
            .map((m) => m[1])
            .filter((t) => t.startsWith(`${page}.`))
            .slice(0, 2);
      const parts = known.map((tag) => equation(text, tag)).filter((e) => e !== null);
      const files = [...new Set(known.flatMap((tag) => sources[tag] ?? []))].slice(0, 4);
      return h(
        "section",
        { class: "card theory-card" },
        h("h3", {}, heading(text)),
        h("p", { class: "muted" }, question(text)),
        ...parts.map((e) => h("pre", { class: "equation", tabindex: 0 }, e)),
        files.length ? h("p", { class: "files" }, "In the engine: ", ...files.flatMap((f, i) => [i ? ", " : "", h("code", {}, f)])) : null,
        h("p", {}, h("a", { href: `#/theory/${page}` }, `Read more: ${heading(text).toLowerCase()}`)),
      );
    }),
  );
  return made.filter((c) => c !== null);
}
