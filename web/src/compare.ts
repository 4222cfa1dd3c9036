/** Two ways that time went, compared: what was changed, how far they are apart, the old one as a ghost, and the way back to it. */
import { difference, fieldOf, type Measure, ofField, ofPositions } from "./apart";
import type { Change } from "./branch";
import { check, choice, h, show } from "./dom";
import type { Frame, SceneInfo, Value } from "./engine/protocol";
import { Plot } from "./plot";
import type { Session } from "./session";
import { literal } from "./values";
import { Ghost } from "./view/ghost";
import { gridsOf, massesOf } from "./view/scenery";
import type { Stage } from "./view/stage";

function short(value: Value | null): string {
  const text = value === null ? "not set" : literal(value);
  return text.length > 60 ? `${text.slice(0, 57)} …` : text;
}

const told = ({ path, from, to, frame }: Change): string =>
  `${path ? `${path}: ${short(from)} → ${short(to)}` : "by the pointer"}, from frame ${frame}`;

const names = (objects: SceneInfo["objects"]): string[] => objects.map((o) => o.name);

export class Comparison {
  /** The changes, and the actions on the previous branch. */
  readonly bar = h("section", { class: "before", "aria-label": "Previous and current branch", hidden: true });
  /** How far apart, against time. */
  readonly chart: HTMLElement;
  private readonly plot: Plot;
  private readonly title = h("h2", {});
  private readonly value = h("output", { class: "value", "aria-label": "Current distance", "aria-live": "off" });
  private readonly what = h("span", {});
  private readonly ghost: Ghost;
  private seen: "now" | "before" | "difference" = "now";
  private ghostly = true;
  private measured: "positions" | "field" = "positions";
  private running = false;
  private readonly known = new WeakMap<Frame, { other: Frame; of: string; value: number | null }>();

  constructor(
    private readonly session: Session,
    private readonly stage: Stage,
    /** Told when something was drawn. */
    private readonly drawn: () => void,
  ) {
    this.ghost = new Ghost(stage.scene);
    this.plot = new Plot([{ label: "apart", color: 4, width: 2, spans: true }], {
      label: "Distance between the branches against time",
      x: "time [s]",
      height: 140,
      mark: () => session.shown?.time ?? null,
    });
    this.chart = h(
      "div",
      { class: "energy apart", hidden: true },
      this.title,
      h("ul", { class: "curves" }, h("li", {}, this.what, this.value)),
      this.plot.element,
    );
    session.on("before", () => this.open());
    session.on("loaded", () => this.open());
  }

  private get dark(): boolean {
    return this.stage.night || document.documentElement.dataset.theme === "dark";
  }

  theme(): void {
    this.ghost.open(this.session.before?.info ?? null, this.dark);
    this.again();
  }

  /** Whether frames of both ways mean the same times. */
  private get alike(): boolean {
    const { before, info } = this.session;
    return !!before && before.info.dt === info?.dt;
  }

  /** The frame of the old way at the time of another. */
  private other(frame: Frame): Frame | undefined {
    const { before } = this.session;
    if (!before) return undefined;
    const index = Math.round(frame.time / before.info.dt);
    if (index > before.way.last) return undefined;
    return before.way.frame(index) ?? before.way.near(index);
  }

  /** The field that is shown, by what there is in the last frame. */
  private get field(): { name: string; unit: string } | null {
    const { session } = this;
    const frame = session.frame(session.latest) ?? session.shown;
    return frame && session.info ? fieldOf(frame, names(gridsOf(session.info)), this.stage.look.field) : null;
  }

  /** A kept frame of the way that is shown. */
  readonly past = (index: number): Frame | undefined =>
    (this.seen === "before" ? this.session.before?.way.frame(index) : undefined) ?? this.session.frame(index);

  /** Total energies of the old way at these times, from its start on [J]. */
  energies(times: number[]): (number | null)[] {
    const { before } = this.session;
    if (!before) return times.map(() => null);
    const { ledgers } = before.way;
    const base = ledgers[0]?.external ?? 0;
    return times.map((time) => {
      const at = time / before.info.dt;
      const [low, high] = [ledgers[Math.floor(at + 1e-6)], ledgers[Math.ceil(at - 1e-6)]];
      if (!low || !high) return null;
      const share = Math.min(Math.max(at - Math.floor(at + 1e-6), 0), 1);
      return low.energy + share * (high.energy - low.energy) - base;
    });
  }

  /** Time at which the old way ends [s]. */
  get end(): number {
    const { before } = this.session;
    return before ? before.way.last * before.info.dt : 0;
  }

  private open(): void {
    const { before, info } = this.session;
    this.bar.hidden = this.chart.hidden = !before;
    this.ghost.open(before?.info ?? null, this.dark);
    if (!before || !info) {
      this.seen = "now";
      this.again();
      return;
    }
    const grids = names(gridsOf(info));
    const masses = massesOf(info);
    const fits =
      grids.length > 0 &&
      grids.every(
        (name) =>
          JSON.stringify([...(before.info.topology[name]?.grid_cells?.data ?? [])]) ===
          JSON.stringify([...(info.topology[name]?.grid_cells?.data ?? [])]),
      );
    if (!fits) this.seen = "now";
    if (!masses.length || !grids.length) this.measured = grids.length ? "field" : "positions";
    const changes = before.changes.map(told);
    if (changes.length > 3) changes.splice(3, changes.length, `and ${before.changes.length - 3} more`);
    const parts: (HTMLElement | null)[] = [
      massesOf(before.info).length
        ? check("Ghost of the previous branch", this.ghostly, (on) => {
            this.ghostly = on;
            this.again();
          })
        : null,
      fits
        ? choice(
            "Branch shown",
            [
              ["now", "current"],
              ["before", "previous"],
              ["difference", "difference"],
            ],
            this.seen,
            (v) => {
              this.seen = v as typeof this.seen;
              this.again();
            },
          )
        : null,
      masses.length && grids.length
        ? choice(
            "Distance in",
            [
              ["positions", "positions"],
              ["field", "field"],
            ],
            this.measured,
            (v) => {
              this.measured = v as typeof this.measured;
              this.draw();
            },
          )
        : null,
      this.shorter ? this.runButton() : null,
      h("button", { type: "button", class: "button", onclick: () => void this.session.takeBefore() }, "Return to the previous branch"),
      h("button", { type: "button", class: "button", onclick: () => void this.session.forgetBefore() }, "Discard it"),
    ];
    this.bar.replaceChildren(
      h("div", { class: "before-head" }, h("h2", {}, "Previous and current branch"), h("p", { class: "changes" }, changes.join("; "))),
      h("div", { class: "before-acts" }, ...parts),
      h("p", { class: "muted" }, `The previous branch is at frame ${before.way.last}, hash `, h("code", {}, before.hash)),
    );
    this.draw();
  }

  /** Whether the old way ends before that of now. */
  private get shorter(): boolean {
    const { session } = this;
    return !!session.before && this.end < (session.frame(session.latest)?.time ?? 0) - 0.5 * session.before.info.dt;
  }

  private runButton(): HTMLButtonElement {
    const button = h("button", { type: "button", class: "button catch-up" }, "Advance the previous branch as far");
    button.onclick = () => {
      if (this.running) {
        this.running = false;
        return;
      }
      this.running = true;
      void this.session
        .catchUp((index) => {
          button.textContent = `Frame ${index} … stop`;
          return this.running;
        })
        .finally(() => (this.running = false));
    };
    return button;
  }

  /** Draws a frame, and beside it or instead of it what was before. */
  show(frame: Frame): void {
    const old = this.other(frame);
    const field = this.seen === "difference" ? this.field : null;
    if (old && this.seen === "before") this.stage.show(old);
    else if (old && field && old.index === frame.index && !frame.inside) this.stage.show(difference(frame, old, field.name));
    else this.stage.show(frame);
    this.ghost.show(this.ghostly && this.seen !== "before" ? old : undefined);
    this.drawn();
    if (this.session.before && !this.running && this.shorter === !this.bar.querySelector(".catch-up")) this.open();
    else this.draw();
  }

  /** Draws the frame once more: the look has changed. */
  again(): void {
    if (this.session.shown) this.show(this.session.shown);
  }

  /** How far apart the ways are at a frame: 0 where they are still one. */
  at(index: number, field = this.measured === "field" ? this.field : null): number | null {
    const { before, info } = this.session;
    const [a, b] = [this.session.frame(index), before?.way.frame(index)];
    if (!a || !b || !info || !this.alike) return null;
    const of = field?.name ?? "positions";
    const known = this.known.get(a);
    if (known?.other === b && known.of === of) return known.value;
    const measure: Measure = field ? ofField(field.name) : ofPositions(names(massesOf(info)));
    const value = measure(a, b);
    this.known.set(a, { other: b, of, value });
    return value;
  }

  private draw(): void {
    const { session } = this;
    if (!session.before || !session.info) return;
    const field = this.measured === "field" ? this.field : null;
    const count = Math.max(session.latest, Math.round(this.end / session.info.dt)) + 1;
    const times = Array.from({ length: count }, (_, i) => i * session.info!.dt);
    this.plot.set([times, times.map((_, i) => this.at(i, field))]);
    const now = session.shown ? this.at(session.shown.index, field) : null;
    this.title.replaceChildren("Apart", h("span", { class: "unit" }, field ? field.unit : "m"));
    this.what.textContent = !this.alike
      ? "frame sizes differ: not compared"
      : field
        ? `rms difference of ${field.name}`
        : "rms distance of corresponding masses";
    this.value.textContent = show(now, 3);
  }

  close(): void {
    this.running = false;
    this.plot.close();
    this.ghost.dispose();
  }
}
