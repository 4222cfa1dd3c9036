/** Switches for families of links: the engine goes on without one, and gets it back as it was. */
import { parse } from "smol-toml";
import { check, h } from "./dom";
import type { SceneInfo, Value } from "./engine/protocol";
import { changed, FAMILIES, type Family, isOn, type Linked, linked, RESISTS } from "./links";

type Settings = Record<string, Value | null>;

export class FamilySwitches {
  readonly element = h("div", { class: "families" });
  /** Settings of families that are off, by path. */
  private had = new Map<string, Settings>();
  private toml = "";
  private info: SceneInfo | null = null;
  private drawn = "";

  /** `set` changes a value; `what` says it to people. */
  constructor(private readonly set: (path: string, value: Value, what: string) => Promise<void>) {}

  open(info: SceneInfo, toml: string): void {
    if (toml !== this.toml) this.had.clear();
    this.toml = toml;
    this.info = info;
    const objects = linked(info);
    for (const { path, families } of objects) for (const f of FAMILIES) if (isOn(families[f])) this.had.set(`${path}.${f}`, families[f]!);
    const rows = objects
      .map((o) => ({ o, own: FAMILIES.filter((f) => o.families[f] || this.had.has(`${o.path}.${f}`)) }))
      .filter(({ own }) => own.length);
    // Switches in use are not made anew under the fingers.
    const drawn = JSON.stringify(rows.map(({ o, own }) => [o.name, o.path, o.clamped, own.map((f) => [f, isOn(o.families[f])])]));
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const focused = document.activeElement?.closest<HTMLElement>("[data-family]")?.dataset.family;
    const all = FAMILIES.filter((f) => rows.some(({ own }) => own.includes(f)));
    const say = h(
      "p",
      { class: "doc", id: "families-say" },
      ...all.flatMap((f, i) => [i ? " " : "", h("strong", {}, f), ` ${RESISTS[f]}`]),
      " A family that is off exerts no force; the world goes on from where it stands.",
    );
    this.element.replaceChildren(...rows.map(({ o, own }) => this.group(o, own)), ...(rows.length ? [say] : []));
    if (focused) this.element.querySelector<HTMLElement>(`[data-family="${CSS.escape(focused)}"] input`)?.focus();
  }

  private group(o: Linked, own: Family[]): HTMLElement {
    const boxes = own.map((family) => {
      const box = check(family, isOn(o.families[family]), (on) => void this.turn(o.name, family, on));
      box.dataset.family = `${o.path}.${family}`;
      box.querySelector("input")!.setAttribute("aria-describedby", "families-say");
      return box;
    });
    return h("fieldset", {}, h("legend", {}, `Links of ${o.name}`), ...boxes);
  }

  private async turn(name: string, family: Family, on: boolean): Promise<void> {
    const o = this.info && linked(this.info).find((l) => l.name === name);
    if (!o) return;
    // Whatever comes of it, the switch shows it.
    this.drawn = "";
    const settings = on ? (this.had.get(`${o.path}.${family}`) ?? this.written(o, family)) : null;
    await this.set(o.path, changed(o, family, settings), `${name} ${on ? "with" : "without"} ${family} links`);
  }

  /** Settings in the scene's text for a family that was off at load; otherwise the defaults of a sheet. */
  private written(o: Linked, family: Family): Settings {
    const usual: Settings = { modulus: { structural: 500, shear: 200, bend: 10 }[family] };
    try {
      const [kind, index] = o.path.split(".");
      const said = (parse(this.toml) as any)[kind]?.[Number(index)]?.links?.[family];
      const settings: Settings = typeof said === "number" ? { modulus: said } : said;
      return isOn(settings) ? settings : usual;
    } catch {
      return usual;
    }
  }
}
