/** Controls for the values of a scene, made from its schema: label, unit, range, what the word means. */
import { parse } from "smol-toml";
import { check, h, show } from "./dom";
import { METHODS } from "./engine/measures";
import type { SceneInfo, Stability, Value } from "./engine/protocol";
import { ofSteps, type Range, range } from "./ranges";
import { chosen, label, told, unitOf, word } from "./texts";
import { valueAt } from "./values";

type Schema = Record<string, any>;
type Tree = Record<string, any>;

/** Keys that panels leave to the text. */
const LEFT_OUT = new Set([
  "version",
  "title",
  "output",
  "expect",
  "camera",
  "name",
  "precision",
  "bits",
  "dimension",
  "plane",
  "color",
  "color_to",
  "color_end",
]);

/** The most telling words of what moves particles, by table and kind: they come first. */
const TELLING: Record<string, string[]> = {
  emitter: ["rate", "speed", "cone", "lifetime"],
  galaxy: ["toomre", "thickness", "stars"],
  "system.vicsek": ["noise", "speed", "radius"],
  "force.flock": ["cohesion", "alignment", "separation", "speed", "view", "fear"],
  "force.gravitation": ["constant", "softening"],
  "force.turbulence": ["strength", "scale", "rate"],
  "force.vortex": ["swirl", "inward", "lift"],
  "force.attraction": ["gm"],
  "force.lennard_jones": ["epsilon"],
  "force.wind": ["rate", "coefficient"],
  "force.magnetic": ["field"],
  "force.electric": ["field"],
  "field.turbulence": ["strength", "scale", "rate"],
  "field.vortex": ["swirl", "inward", "lift"],
  "field.swirl": ["rate"],
  "field.sink": ["rate"],
  "field.uniform": ["velocity"],
};

/** The method in force: `position_based` stands under either key. */
const methodOf = ({ method, integrator }: Tree): string => (method === "dynamics" && integrator === "position_based" ? integrator : method);

/** Whether a word of a system means anything under its method and integrator. */
function inForce(key: string, system: Tree): boolean {
  const { integrator } = system;
  const method = methodOf(system);
  const positions = method === "position_based";
  const { masses } = METHODS[method];
  const stepped = METHODS[method].stepped && !positions;
  const rules: Record<string, boolean> = {
    integrator: stepped,
    adaptive: stepped && ["adaptive_euler", "dormand_prince"].includes(integrator),
    solver: stepped && ["implicit_euler", "implicit_midpoint", "bdf2"].includes(integrator),
    clamp: positions || (stepped && ["modified_euler", "verlet"].includes(integrator)),
    self_contact: masses,
  };
  return rules[key] ?? (!(key in METHODS) || key === method);
}

/** So many of them, at most, so that the rest stays in sight. */
const MOST_TELLING = 9;

/** A schema without its references; what stands beside a reference counts. */
function resolve(node: Schema, all: Schema): Schema {
  let found = node;
  for (let depth = 0; depth < 8; depth++) {
    if (found.$ref) {
      const { $ref, ...rest } = found;
      const target = all.$defs[String($ref).split("/").pop()!] as Schema;
      found = { ...target, ...rest, description: rest.description || target.description };
      continue;
    }
    const some = (found.anyOf ?? []).filter((b: Schema) => b.type !== "null");
    if (found.anyOf && some.length === 1) {
      const { anyOf: _, ...rest } = found;
      found = { ...some[0], ...rest };
      continue;
    }
    break;
  }
  return found;
}

/** The branch of a choice of tables that a value is. */
function branch(schema: Schema, value: any, all: Schema): Schema | null {
  const branches: Schema[] = schema.oneOf ?? schema.anyOf ?? [];
  for (const raw of branches) {
    const b = resolve(raw, all);
    if (typeof value === "number" && (b.type === "number" || b.type === "integer")) return b;
    if (typeof value === "string" && (b.type === "string" || "const" in b) && (!("const" in b) || b.const === value)) return b;
    if (Array.isArray(value) && b.type === "array") return b;
    if (value && typeof value === "object" && !Array.isArray(value) && b.properties) {
      const kind = b.properties.kind?.const;
      if (kind !== undefined ? kind === value.kind : Object.keys(value).every((k) => k in b.properties)) return b;
    }
  }
  return null;
}

const typeOf = (schema: Schema): string => (Array.isArray(schema.type) ? schema.type.find((t: string) => t !== "null") : schema.type) ?? "";
const plain = (key: string): string => key.replace(/_/g, " ");

let count = 0;

export class Panel {
  readonly element = h("div", { class: "panel" });
  private readonly groups = h("div", { class: "groups" });
  private readonly note = h("p", { class: "note", role: "status" });
  private everything = false;
  /** Paths of the most telling values, which are not shown twice. */
  private shown = new Set<string>();
  private opened = new Set<string>();
  private closed = new Set<string>();
  private info: SceneInfo | null = null;
  private explicit: Tree = {};
  private toml = "";
  /** Of sliders, as the scene was opened: they do not move with the value. */
  private ranges = new Map<string, Range>();
  private stability: Stability[] = [];

  constructor(
    private readonly schema: Schema,
    private readonly set: (path: string, value: Value) => Promise<void>,
  ) {
    this.element.append(
      h(
        "div",
        { class: "panel-head" },
        check("All keys, with defaults", false, (on) => {
          this.everything = on;
          this.draw();
        }),
      ),
      this.groups,
      this.note,
    );
  }

  open(info: SceneInfo, toml: string, overrides: Map<string, Value>): void {
    try {
      this.explicit = parse(toml) as Tree;
    } catch {
      this.explicit = {};
    }
    if (toml !== this.toml) this.ranges.clear();
    this.toml = toml;
    for (const [path, value] of overrides) mark(this.explicit, path.split("."), value);
    const same = this.info && JSON.stringify(shape(this.info.scene)) === JSON.stringify(shape(info.scene));
    this.info = info;
    // A panel in use is not made anew under the fingers.
    if (same && this.groups.contains(document.activeElement)) return;
    const path = document.activeElement?.closest<HTMLElement>("[data-path]")?.dataset.path;
    this.draw();
    if (path) this.groups.querySelector<HTMLElement>(`[data-path="${CSS.escape(path)}"] :is(select, input:not([tabindex]))`)?.focus();
  }

  /** Which steps are stable. */
  limits(list: Stability[]): void {
    this.stability = list;
    const stepped = /^system\.\d+\.(step|substeps)$/;
    for (const path of [...this.ranges.keys()]) if (stepped.test(path)) this.ranges.delete(path);
    for (const row of this.groups.querySelectorAll<HTMLElement>("[data-path]")) {
      const path = row.dataset.path!;
      const value = valueAt(this.info?.scene, path);
      if (!stepped.test(path) || typeof value !== "number" || row.contains(document.activeElement)) continue;
      const item = resolve(resolve(this.schema.properties.system, this.schema).items, this.schema);
      const key = path.split(".").pop()!;
      row.replaceWith(this.row(path, value, resolve(item.properties[key], this.schema), key)!);
    }
  }

  /** Steps of a system that are stable: the longest [s], and how many of them make an interval. */
  private stable(path: string): { says: string; step: [number, number]; substeps: [number, number] } | null {
    const scene = this.info?.scene as Tree;
    const system = valueAt(scene, path.split(".").slice(0, 2).join(".")) as Tree;
    const interval = 1 / scene.time.fps / scene.time.exchanges;
    const found = this.stability.find((s) => s.system === system.name);
    const limit = found?.limits.find((l) => l.integrator === found.integrator)?.usable;
    if (limit === 0) return { says: "No step is stable with this integrator.", step: [interval / 1000, interval], substeps: ofSteps(1000) };
    if (!limit) {
      const says = found && limit === null ? "Stable at every step." : "";
      return { says, step: [interval / 100, interval], substeps: ofSteps(Math.max(interval / 1e-3, 10)) };
    }
    const steps = Math.max(Math.ceil(interval / limit - 1e-6), 1);
    return {
      says: `Stable from ${steps} sub-step${steps > 1 ? "s" : ""} on, each of ${show(interval / steps, 3)} s.`,
      step: [Math.min(limit / 20, interval), Math.min(4 * limit, interval)],
      substeps: ofSteps(steps),
    };
  }

  say(text: string, bad = false): void {
    this.note.textContent = text;
    this.note.classList.toggle("bad", bad);
  }

  private draw(): void {
    if (!this.info) return;
    const scene = this.info.scene as Tree;
    const groups: Node[] = [];
    this.shown.clear();
    const play = this.play(scene);
    if (play) groups.push(play);
    for (const [key, raw] of Object.entries(this.schema.properties as Record<string, Schema>)) {
      const value = scene[key];
      if (LEFT_OUT.has(key) || value === null || value === undefined) continue;
      const schema = resolve(raw, this.schema);
      if (Array.isArray(value)) {
        value.forEach((entry, i) => {
          const item = resolve(schema.items ?? {}, this.schema);
          const name = entry?.name ?? entry?.kind ?? String(i + 1);
          const group = this.group(`${key}.${i}`, entry, item, this.explicit[key]?.[i], `${name}`, label(key));
          if (group) groups.push(group);
        });
      } else if (typeof value === "object") {
        const group = this.group(key, value, schema, this.explicit[key], label(key), "");
        if (group) groups.push(group);
      } else if (key in this.explicit || this.everything) {
        const row = this.row(key, value, schema, key);
        if (row) groups.push(row);
      }
    }
    this.groups.replaceChildren(...groups);
    if (!groups.length) this.groups.append(h("p", { class: "muted" }, "This scene uses only defaults."));
  }

  /** The values that one would like to turn first. */
  private play(scene: Tree): HTMLElement | null {
    const entries: [string, string, Tree, Schema][] = [];
    const take = (table: string, path: string, entry: Tree, schema: Schema) => {
      entries.push([table === "emitter" || table === "galaxy" ? table : `${table}.${entry.kind}`, path, entry, schema]);
      const air = (entry.air ?? []) as Tree[];
      const own = air.length ? branch(schema, entry, this.schema) : null;
      air.forEach((field, i) =>
        take("field", `${path}.air.${i}`, field, resolve(resolve(own!.properties.air, this.schema).items, this.schema)),
      );
    };
    for (const table of ["galaxy", "force", "field", "emitter"]) {
      const list = (scene[table] ?? []) as Tree[];
      const items = resolve(resolve(this.schema.properties[table], this.schema).items, this.schema);
      list.forEach((entry, i) => take(table, `${table}.${i}`, entry, items));
    }
    const systems = resolve(resolve(this.schema.properties.system, this.schema).items, this.schema);
    for (const [i, s] of (scene.system as Tree[]).entries()) {
      const own = s[s.method] as Tree | null;
      if (own) entries.push([`system.${s.method}`, `system.${i}.${s.method}`, own, resolve(systems.properties[s.method], this.schema)]);
    }
    const sets: HTMLElement[] = [];
    for (const [kind, path, entry, schema] of entries) {
      const own = schema.properties ? schema : branch(schema, entry, this.schema);
      const rows: HTMLElement[] = [];
      for (const key of TELLING[kind] ?? []) {
        const value = entry[key];
        if (!own?.properties?.[key] || value === null || value === undefined || value === 0 || this.shown.size >= MOST_TELLING) continue;
        const row = this.row(`${path}.${key}`, value, resolve(own.properties[key], this.schema), key);
        if (!row) continue;
        rows.push(row);
        this.shown.add(`${path}.${key}`);
      }
      if (rows.length)
        sets.push(
          h("fieldset", { class: "sub" }, h("legend", {}, label(String(entry.name ?? entry.kind ?? kind.split(".").pop()))), ...rows),
        );
    }
    if (!sets.length) return null;
    const group = this.details("play", "Play with", "", sets);
    group.classList.add("play");
    return group;
  }

  private group(path: string, value: Tree, schema: Schema, explicit: Tree | undefined, title: string, kind: string): HTMLElement | null {
    const rows = this.rows(path, value, schema, explicit);
    return rows.length ? this.details(path, title, kind, rows) : null;
  }

  /** A collapsible section that remembers its state. */
  private details(path: string, title: string, kind: string, rows: HTMLElement[]): HTMLElement {
    const open = this.opened.has(path) || (!this.closed.has(path) && !["collider", "camera", "time"].includes(path.split(".")[0]));
    const details = h(
      "details",
      { open, class: "group" },
      h("summary", {}, h("span", { class: "group-title" }, title), kind ? h("span", { class: "group-kind" }, kind) : null),
      ...rows,
    );
    details.addEventListener("toggle", () => {
      (details.open ? this.opened : this.closed).add(path);
      (details.open ? this.closed : this.opened).delete(path);
    });
    return details;
  }

  private rows(path: string, value: Tree, schema: Schema, explicit: Tree | undefined): HTMLElement[] {
    const own = schema.properties ? schema : branch(schema, value, this.schema);
    if (!own?.properties) return [];
    const rows: HTMLElement[] = [];
    const system = /^system\.\d+$/.test(path);
    for (const [key, raw] of Object.entries(own.properties as Record<string, Schema>)) {
      if (LEFT_OUT.has(key) || key === "kind" || key === "system" || (system && !inForce(key, value))) continue;
      const inner = value?.[key];
      if (inner === null || inner === undefined) continue;
      const said = explicit?.[key] !== undefined || (system && (key === "method" || key === "integrator"));
      if ((!said && !this.everything) || this.shown.has(`${path}.${key}`)) continue;
      const row = this.row(
        `${path}.${key}`,
        system && key === "method" ? methodOf(value) : inner,
        resolve(raw as Schema, this.schema),
        key,
        explicit?.[key],
      );
      if (row) rows.push(row);
    }
    return rows;
  }

  private row(path: string, value: any, schema: Schema, key: string, explicit?: any): HTMLElement | null {
    const unit = schema["x-unit"] && schema["x-unit"] !== "1" ? String(schema["x-unit"]) : "";
    let kind = schema;
    if (schema.oneOf || schema.anyOf) {
      const words: string[] = (schema.oneOf ?? schema.anyOf).flatMap((b: Schema) => ("const" in b ? [String(b.const)] : (b.enum ?? [])));
      if (typeof value === "string" && words.includes(value))
        return this.field(path, key, schema, "", (id) => this.select(id, path, value, schema));
      const found = branch(schema, value, this.schema);
      if (!found) return null;
      // What stands beside a choice counts for the branch, bounds among it.
      const { oneOf: _, anyOf: __, ...beside } = schema;
      kind = { ...found, ...beside };
    }
    const type = typeOf(kind);
    const units = unit || (kind["x-unit"] && kind["x-unit"] !== "1" ? String(kind["x-unit"]) : "");
    if (typeof value === "boolean") return this.field(path, key, kind, "", (id) => this.toggle(id, path, value));
    if (typeof value === "number")
      return this.field(path, key, kind, units, (id) => this.number(id, path, value, kind, type === "integer"));
    if (typeof value === "string") {
      if (Array.isArray(kind.enum))
        return this.field(path, key, kind, "", (id) =>
          this.select(id, path, value, { oneOf: kind.enum.map((c: string) => ({ const: c })) }),
        );
      return this.field(path, key, kind, units, (id) => this.text(id, path, value));
    }
    if (Array.isArray(value)) {
      if (value.length && value.length <= 4 && value.every((v) => typeof v === "number" || typeof v === "string"))
        return this.field(path, key, kind, units, (id) => this.vector(id, path, value));
      if (value.length && value.every((v) => v && typeof v === "object" && !Array.isArray(v))) {
        const item = resolve(kind.items ?? {}, this.schema);
        const groups = value
          .map((v, i) => this.group(`${path}.${i}`, v, item, explicit?.[i], v.name ?? v.kind ?? `${plain(key)} ${i + 1}`, ""))
          .filter((g) => g !== null);
        return groups.length ? h("div", { class: "nested" }, ...groups) : null;
      }
      return null;
    }
    if (typeof value === "object") {
      const rows = this.rows(path, value, kind, typeof explicit === "object" ? explicit : undefined);
      if (!rows.length) return null;
      return h("fieldset", { class: "sub" }, h("legend", {}, label(key)), ...rows);
    }
    return null;
  }

  private field(path: string, key: string, schema: Schema, unit: string, control: (id: string) => HTMLElement): HTMLElement {
    const id = `v${++count}`;
    // A choice says itself what it means.
    const doc = schema.oneOf ? "" : told(this.owner(path), key, String(schema.description ?? ""));
    const stepped = /^system\.\d+\.(step|substeps)$/.test(path) ? this.stable(path)?.says : "";
    const body = control(id);
    if (doc || stepped) body.querySelector(`#${id}`)!.setAttribute("aria-describedby", `${id}d`);
    return h(
      "div",
      { class: "field", "data-path": path },
      h(
        "div",
        { class: "field-head" },
        h("label", { for: id }, label(key)),
        unit ? h("span", { class: "unit" }, unitOf(path, unit)) : null,
      ),
      body,
      doc || stepped ? h("p", { class: "doc", id: `${id}d` }, [doc, stepped].filter(Boolean).join(" ")) : null,
    );
  }

  /** The table that a value stands in, or its kind. */
  private owner(path: string): string {
    const keys = path.split(".").slice(0, -1);
    const entry = keys.length ? (valueAt(this.info?.scene, keys.join(".")) as Tree | null) : null;
    return String(entry?.kind ?? keys.findLast((k) => !/^\d+$/.test(k)) ?? "");
  }

  /** Another method; what is written as an integrator would otherwise stay in force. */
  private async method(path: string, value: string): Promise<void> {
    const system = path.replace(/method$/, "");
    const said = valueAt(this.explicit, system.slice(0, -1)) as Tree | null;
    const written = said?.integrator === "position_based";
    if (!written || value !== "dynamics" || (said?.method ?? "dynamics") !== "dynamics") await this.set(path, value);
    if (written && value !== "position_based") await this.set(`${system}integrator`, "implicit_euler");
  }

  /** A value below a table that the text leaves out is set with all of its table, so that the rest keeps its value. */
  private async send(path: string, value: Value): Promise<void> {
    const keys = path.split(".");
    let [said, now]: any[] = [this.explicit, this.info?.scene];
    for (const [i, key] of keys.slice(0, -1).entries()) {
      said = said?.[key];
      now = now?.[key];
      if (Array.isArray(now) || !now || typeof now !== "object") continue;
      if (said && typeof said === "object") continue;
      const table = structuredClone(now);
      keys.slice(i + 1, -1).reduce((at, k) => at[k], table)[keys.at(-1)!] = value;
      return this.set(keys.slice(0, i + 1).join("."), full(table));
    }
    await this.set(path, value);
  }

  private number(id: string, path: string, value: number, schema: Schema, whole: boolean): HTMLElement {
    const input = h("input", {
      id,
      type: "number",
      value: String(value),
      step: "any",
      min: schema.minimum ?? false,
      max: schema.maximum ?? false,
      inputmode: whole ? "numeric" : "decimal",
    });
    const key = path.split(".").pop()!;
    let span = this.ranges.get(path);
    if (!span || value < span.low || value > span.high) {
      const known = /^system\.\d+\.(step|substeps)$/.test(path) ? this.stable(path)?.[key as "step" | "substeps"] : undefined;
      this.ranges.set(path, (span = range(value, key, String(schema["x-unit"] ?? ""), schema, whole, known)));
    }
    const { log } = span;
    const [from, to] = log ? [Math.log10(span.low), Math.log10(span.high)] : [span.low, span.high];
    const slider = h("input", {
      type: "range",
      min: from,
      max: to,
      step: (to - from) / 200,
      value: log ? Math.log10(Math.max(value, span.low)) : value,
      tabindex: -1,
      "aria-hidden": "true",
    });
    let timer = 0;
    slider.addEventListener("input", () => {
      let v = log ? 10 ** Number(slider.value) : Number(slider.value);
      // What runs by factors ends at nothing, where it may be nothing.
      if (log && schema.minimum === 0 && Number(slider.value) <= from + 1e-9) v = 0;
      v = whole ? Math.round(v) : Number(v.toPrecision(3));
      if (schema.exclusiveMinimum !== undefined && v <= schema.exclusiveMinimum) return;
      if (schema.minimum !== undefined) v = Math.max(v, schema.minimum);
      input.value = String(v);
      clearTimeout(timer);
      timer = window.setTimeout(() => void this.send(path, v), 160);
    });
    input.addEventListener("change", () => {
      const v = Number(input.value);
      if (input.value === "" || !Number.isFinite(v)) return void (input.value = String(value));
      slider.value = String(log ? Math.log10(Math.max(v, 1e-300)) : v);
      void this.send(path, whole ? Math.round(v) : v);
    });
    return h("div", { class: "control" }, slider, input);
  }

  private select(id: string, path: string, value: string, schema: Schema): HTMLElement {
    const method = /^system\.\d+\.method$/.test(path);
    const may = (v: string) =>
      method
        ? v === value || (METHODS[v]?.stepped && METHODS[value]?.stepped)
        : v === value || !/^system\.\d+\.integrator$/.test(path) || v !== "position_based";
    const branches = ((schema.oneOf ?? schema.anyOf) as Schema[])
      .flatMap((b): [string, string][] =>
        "const" in b ? [[String(b.const), String(b.description ?? "")]] : (b.enum ?? []).map((e: string): [string, string] => [e, ""]),
      )
      .filter(([v]) => may(v));
    const says = h("p", { class: "doc says" });
    const tell = (v: string) => (says.textContent = chosen(v, branches.find((b) => b[0] === v)?.[1] ?? ""));
    const list = h(
      "select",
      {
        id,
        onchange: () => {
          tell(list.value);
          void (method ? this.method(path, list.value) : this.send(path, list.value));
        },
      },
      ...branches.map(([v]) => h("option", { value: v, selected: v === value }, word(v))),
    );
    tell(value);
    return h("div", { class: "control wide" }, list, says);
  }

  private toggle(id: string, path: string, value: boolean): HTMLElement {
    const box = h("input", { id, type: "checkbox", checked: value, onchange: () => void this.send(path, box.checked) });
    return h("div", { class: "control wide" }, box);
  }

  private text(id: string, path: string, value: string): HTMLElement {
    const input = h("input", { id, type: "text", value, spellcheck: "false", onchange: () => void this.send(path, input.value) });
    return h("div", { class: "control wide" }, input);
  }

  private vector(id: string, path: string, value: (number | string)[]): HTMLElement {
    const words = value.some((v) => typeof v === "string");
    const inputs = value.map((v, i) =>
      h("input", {
        id: i ? `${id}-${i}` : id,
        type: "text",
        inputmode: words ? "text" : "decimal",
        value: typeof v === "number" ? String(Number(v.toPrecision(7))) : v,
        "aria-label": i ? `component ${i + 1}` : false,
        onchange: () => {
          const next = inputs.map((el, k) =>
            el.value.trim() !== "" && Number.isFinite(Number(el.value)) ? Number(el.value) : words ? el.value : value[k],
          );
          void this.send(path, next as Value);
        },
      }),
    );
    return h("div", { class: "control vector" }, ...inputs);
  }
}

/** Without what is not there: TOML has no word for it. */
function full(tree: any): Value {
  if (Array.isArray(tree)) return tree.map(full);
  if (!tree || typeof tree !== "object") return tree;
  return Object.fromEntries(Object.entries(tree).flatMap(([k, v]) => (v === null ? [] : [[k, full(v)]])));
}

/** Which keys there are, without their values; what decides about others counts. */
function shape(tree: any): any {
  if (tree && typeof tree === "object" && "method" in tree && "integrator" in tree)
    return [tree.method, tree.integrator, ...Object.keys(tree)];
  if (Array.isArray(tree)) return tree.length > 8 ? tree.length : tree.map(shape);
  if (tree && typeof tree === "object") return Object.fromEntries(Object.entries(tree).map(([k, v]) => [k, shape(v)]));
  return typeof tree;
}

function mark(tree: Tree, path: string[], value: Value): void {
  let at: any = tree;
  for (const [i, key] of path.entries()) {
    if (i === path.length - 1) at[key] = value;
    else if (at[key] === undefined || typeof at[key] !== "object") at = at[key] = {};
    else at = at[key];
  }
}
