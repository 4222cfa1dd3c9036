/** Colours of masses and links by what they do: one scale for all objects of a picture, so that its legend holds for each. */
import type { Column, Form, Frame, Numbers } from "../engine/protocol";
import { FAMILIES, type Family } from "../links";
import { mapOf } from "./colors";
import { Range, type Rgb, scalars } from "./layers";
import { palette, pick } from "./scenery";

export interface Legend {
  name: string;
  unit: string;
  low: number;
  high: number;
}

/** Coloured column. */
export interface Shaded {
  name: string;
  form: Form;
  topology: Record<string, Column>;
  /** Of each link, an index into `FAMILIES`; which of them act. */
  families: Uint8Array | null;
  acting: boolean[];
}

/** Strains below it are what rounding leaves of none. */
const UNSTRAINED = 1e-4;

/** Whether a link is of a family that does not act, or is not drawn. */
export function isLeft(thing: Shaded, link: number, unseen: Family[]): boolean {
  const family = thing.families?.[link];
  return family !== undefined && (!thing.acting[family] || unseen.includes(FAMILIES[family]));
}

/** The mean of what links tell over the links of each mass; those that tell nothing do not count. */
function means(values: Numbers, links: Numbers, n: number): Float32Array {
  const sum = new Float32Array(n);
  const count = new Uint16Array(n);
  values.forEach((v: number, i: number) => {
    if (!Number.isFinite(v)) return;
    for (const p of [links[2 * i], links[2 * i + 1]]) {
      sum[p] += v;
      count[p]++;
    }
  });
  return sum.map((s, i) => s / Math.max(count[i], 1));
}

function joined(lists: Numbers[]): Numbers {
  if (lists.length === 1) return lists[0];
  const all = new Float32Array(lists.reduce((sum, l) => sum + l.length, 0));
  lists.reduce((at, l) => (all.set(l, at), at + l.length), 0);
  return all;
}

export class Shades {
  legend: Legend | null = null;
  private ranges = { speed: new Range(false), strain: new Range(true) };
  private colors = new Map<string, Float32Array>();

  /** Takes the colours of a frame. */
  take(things: Shaded[], frame: Frame, by: "object" | "speed" | "strain", unseen: Family[], linksAreSeen: boolean): void {
    this.legend = null;
    this.colors.clear();
    if (by === "object") return;
    const values = new Map<string, Numbers>();
    const seen: Numbers[] = [];
    for (const thing of things) {
      const { velocity, link_strain, position } = frame.columns[thing.name] ?? {};
      const links = thing.topology.links?.data;
      if (by === "speed" && velocity && velocity.points.length === 0) {
        values.set(thing.name, scalars(velocity));
        seen.push(values.get(thing.name)!);
      } else if (by === "strain" && link_strain && position && links) {
        const own = link_strain.data.map((e, i) => (isLeft(thing, i, unseen) ? NaN : e));
        values.set(thing.name, means(own, links, position.data.length / 3));
        seen.push(linksAreSeen || thing.form === "points" ? own : values.get(thing.name)!);
      }
    }
    if (!seen.length) return;
    const strain = by === "strain";
    this.ranges[by].look(joined(seen));
    let [low, high] = this.ranges[by].pair;
    if (strain && high < UNSTRAINED) [low, high] = [-UNSTRAINED, UNSTRAINED];
    this.legend = { name: by, unit: strain ? "1" : "m/s", low, high };
    const map = palette(mapOf(by));
    for (const [name, list] of values) {
      const colors = new Float32Array(3 * list.length);
      for (let i = 0; i < list.length; i++) colors.set(pick(map, (list[i] - low) / (high - low)), 3 * i);
      this.colors.set(name, colors);
    }
  }

  /** Colours of the masses of an object; null for its own. */
  of(name: string): Float32Array | null {
    return this.colors.get(name) ?? null;
  }

  /** The colour of a link, where strains are shown. */
  link(strain: number): Rgb {
    return pick(palette("strain"), 0.5 + (0.5 * strain) / (this.legend?.high ?? 1));
  }
}
