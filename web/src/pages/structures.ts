/** A rope, a sheet, a block or a net between a wall and a hand: what each family of links resists. */
import { asScene, asSceneButton, figure, slide } from "../demo";
import { check, choice, h, iconButton, type Page, show } from "../dom";
import type { Frame, Value } from "../engine/protocol";
import { FAMILIES, type Family, familiesOf, RESISTS } from "../links";
import { Plot } from "../plot";
import { pointers } from "../pointer";
import { pictureButton } from "../saving";
import { dropped } from "../session";
import { cards } from "../theory";
import { transport } from "../transport";
import { reducedMotion, Viewer } from "../viewer";
import {
  BUILDS,
  type Choices,
  type Deed,
  grip,
  type Kind,
  links,
  MESH,
  mesh,
  SOFT,
  scene,
  springs,
  start,
  strength,
} from "./structures-scene";

const VERBS: Record<Deed, string> = { shear: "Shear it", bend: "Bend it", twist: "Twist it", stretch: "Stretch it" };
const capital = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);

export const page: Page = async (main) => {
  document.title = "Structures · tumble";
  let c: Choices = start("sheet");
  const viewer = new Viewer(
    main,
    "The structure. Drag a mass to pull it; space plays and pauses, arrows rotate the view, plus and minus zoom, 0 resets the view.",
  );
  const { session, stage, canvas } = viewer;
  session.endless = true;
  Object.assign(stage.look, { links: true, color: "strain", hidden: ["places"] });
  session.wanted = () => [...new Set([...stage.wanted, "link_strain"])];
  const about = h("p", { class: "doc", id: "about" });
  const plot = new Plot([{ label: "energy of the links", color: 0, width: 2 }], {
    label: "Elastic energy of the links against time",
    x: "time [s]",
    height: 130,
  });
  const figures = {
    strain: figure("Largest strain", "strain"),
    energy: figure("Energy of the links", "energy"),
    way: figure("Displacement of the end", "way"),
    pull: figure("Force of the hand", "pull"),
  };

  const rebuild = () => {
    if (c.kind === "net") dropped[MESH] = mesh(c);
    return session.load(scene(c));
  };
  /** Changes a value while the world goes on. */
  const set = async (path: string, value: Value) => {
    if (!(await viewer.attempt(() => session.set(path, value)))) session.play();
  };
  const hold = () => set("anchor", springs(c));
  const relink = () => set(`${c.kind}.0.links`, links(c));

  /** By factors of ten around a value, two figures. */
  const factor = (label: string, unit: string, middle: number, value: number, act: (v: number) => void) => {
    const of = (v: number) => Number((10 ** v).toPrecision(2));
    return slide(
      label,
      Math.log10(middle) - 1,
      Math.log10(middle) + 1,
      Math.log10(value),
      (v) => `${show(of(v), 2)} ${unit}`,
      (v) => act(of(v)),
    );
  };

  const which = choice(
    "Structure",
    Object.entries(BUILDS).map(([k, b]) => [k, b.name]),
    c.kind,
    (v) => {
      c = start(v as Kind);
      // A rope is a line without them, too.
      seeLinks(c.kind !== "rope");
      draw();
      void viewer.attempt(rebuild);
    },
  );
  which.querySelector("select")!.id = "structure";
  const deeds = h("div", { class: "deeds", role: "group", "aria-label": "Motion of the hand" });
  const build = h("section", { class: "card" });
  const families = h("section", { class: "card" });
  const hand = h("section", { class: "card" });
  const sights = h("div", { class: "sights", role: "group", "aria-label": "Families of links shown" });
  const strainBox = check("Colour by strain", true, (on) => {
    stage.look.color = on ? "strain" : "object";
    again();
  });
  const asLinks = check("Links alone", true, (on) => {
    seeLinks(on);
    again();
  });
  const seeLinks = (on: boolean) => {
    stage.look.links = asLinks.querySelector("input")!.checked = on;
    sights.hidden = !on;
  };
  const picture = h("section", { class: "card" }, h("h2", {}, "Picture"), strainBox, asLinks, sights);
  const again = () =>
    void session.refresh().then(() => {
      stage.again();
      viewer.tellLegend();
    });

  const press = () => {
    for (const button of deeds.querySelectorAll("button"))
      button.setAttribute("aria-pressed", String((button.dataset.deed || null) === c.deed));
  };
  /** The controls of a structure. */
  const draw = () => {
    const b = BUILDS[c.kind];
    about.textContent = b.about;
    const button = (deed: Deed | null, text: string) =>
      h(
        "button",
        {
          type: "button",
          class: "button",
          "data-deed": deed ?? "",
          "aria-pressed": "false",
          onclick: () => {
            c.deed = deed;
            press();
            void hold();
          },
        },
        text,
      );
    deeds.replaceChildren(...b.deeds.map((deed) => button(deed, VERBS[deed])), button(null, "Let go"));
    press();
    const [least, , most] = b.fineness;
    build.replaceChildren(
      h("h2", {}, "Structure"),
      which,
      about,
      slide(
        b.pieces,
        least,
        most,
        c.fineness,
        String,
        (v) => {
          c.fineness = v;
          void viewer.attempt(rebuild);
        },
        1,
      ),
    );
    families.replaceChildren(
      h("h2", {}, "Families of links"),
      ...b.families.map((family) =>
        h(
          "div",
          { class: "family" },
          check(capital(family), c.on[family], (on) => {
            c.on[family] = on;
            void relink();
          }),
          h("p", { class: "doc" }, capital(RESISTS[family].replace(/^links /, "They "))),
          factor(`Modulus, ${family}`, b.unit, b.modulus[family], c.modulus[family], (v) => {
            c.modulus[family] = v;
            void relink();
          }),
        ),
      ),
    );
    hand.replaceChildren(
      h("h2", {}, "Hand"),
      factor("Springs of the hand", "N/m", b.hand, c.hand, (v) => {
        c.hand = v;
        void hold();
      }),
      h(
        "p",
        { class: "doc" },
        "Springs pull the masses of one end to the hand's target; the other end is pinned. The remaining distance shows the resistance of the structure.",
        b.bend ? "" : ` To bend such a thin structure, 1/${SOFT} of their stiffness is enough.`,
      ),
    );
    sights.replaceChildren(
      ...b.families.map((family) =>
        check(`Show ${family}`, !stage.look.unseen.includes(family), (on) => {
          stage.look.unseen = on ? stage.look.unseen.filter((f) => f !== family) : [...stage.look.unseen, family];
          again();
        }),
      ),
    );
  };

  const theory = h("section", { class: "beside", "aria-label": "Theory" });
  main.append(
    h(
      "div",
      { class: "lab" },
      h(
        "section",
        { class: "view", "aria-label": "Structure" },
        h(
          "div",
          { class: "lab-head" },
          h("div", {}, h("h1", {}, "Structures in the hand"), h("p", { class: "muted" }, "Remove a family of links to see its effect.")),
          h(
            "div",
            { class: "actions" },
            pictureButton(stage, () => c.kind),
            iconButton("frame", "Reset the view", () => stage.goHome()),
            asSceneButton(() => asScene(scene(c), 600)),
          ),
        ),
        viewer.alert,
        viewer.box,
        deeds,
        transport(session),
        h("div", { class: "figures in-line" }, figures.way.row, figures.pull.row, figures.energy.row, figures.strain.row),
        h("div", { class: "energy" }, h("h2", {}, "Energy of the links", h("span", { class: "unit" }, "J")), plot.element),
      ),
      h(
        "aside",
        { class: "side scrolls", "aria-label": "Settings", tabindex: 0 },
        h("div", { class: "controls" }, build, families, hand, picture),
      ),
      theory,
    ),
  );

  draw();

  /** Energy of the links at each time. */
  let curve: [number, number][] = [];
  let family: Uint8Array | null = null;
  let ends: ReturnType<typeof grip> = [];
  const measure = (frame: Frame) => {
    const columns = frame.columns[c.kind];
    const x = columns?.position?.data;
    const strains = columns?.link_strain?.data;
    const ledger = session.ledgers[frame.index];
    if (!x || !strains || !ledger || ends.some((e) => 3 * e.row >= x.length)) return;
    const away = (row: number, p: [number, number, number]) => Math.hypot(x[3 * row] - p[0], x[3 * row + 1] - p[1], x[3 * row + 2] - p[2]);
    let [way, asked, pull, held] = [0, 0, 0, 0];
    for (const { row, from, to } of ends) {
      way += away(row, from) / ends.length;
      if (!to) continue;
      const left = away(row, to);
      asked += Math.hypot(...to.map((v, k) => v - from[k])) / ends.length;
      pull += (strength(c) / ends.length) * left;
      held += 0.5 * (strength(c) / ends.length) * left * left;
    }
    let [largest, of]: [number, Family | null] = [0, null];
    strains.forEach((s, i) => {
      const own = FAMILIES[family?.[i] ?? 0];
      if (c.on[own] && Math.abs(s) > Math.abs(largest)) [largest, of] = [s, own];
    });
    const energy = Math.max(ledger.elastic - held, 0);
    const tell = (f: { value: HTMLElement }, value: number, text: string) => {
      f.value.textContent = text;
      f.value.dataset.value = String(value);
    };
    tell(figures.way, way, `${show(way, 3)} m${asked ? ` of ${show(asked, 3)} m` : ""}`);
    tell(figures.pull, pull, `${show(pull, 3)} N`);
    tell(figures.energy, energy, `${show(energy, 3)} J`);
    tell(figures.strain, largest, of ? `${show(largest, 2)}, ${of}` : "none");
    while (curve.length && curve[curve.length - 1][0] >= frame.time - 1e-9) curve.pop();
    curve.push([frame.time, energy]);
    if (curve.length > 1200) curve = curve.slice(-1000);
    plot.set([curve.map((p) => p[0]), curve.map((p) => p[1])]);
  };
  const took = () => {
    const object = session.info?.objects.find((o) => o.name === c.kind);
    family = object && session.info ? familiesOf(session.info, object) : null;
    ends = grip(c);
  };
  session.on("loaded", (info) => {
    curve = [];
    stage.open(info, session.frame, false);
    took();
  });
  session.on("changed", (info) => {
    stage.changed(info);
    took();
  });
  session.on("frame", (frame) => {
    stage.show(frame);
    viewer.tellLegend();
    measure(frame);
    session.trim(900);
  });

  const offPointers = pointers(canvas, stage, session);
  void cards([
    { page: "structures", tags: ["structures.1", "structures.2", "structures.11"] },
    { page: "springs", tags: ["springs.1", "springs.2", "springs.8"] },
    { page: "bending", tags: [] },
  ]).then((made) => theory.replaceChildren(...made));
  void viewer.begin(rebuild).then((failure) => {
    if (failure || reducedMotion()) return;
    c.deed = "shear";
    press();
    void hold();
  });

  return () => {
    offPointers();
    plot.close();
    viewer.close();
  };
};
