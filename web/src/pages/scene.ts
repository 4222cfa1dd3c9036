/** One scene: picture, playback, energy, its values, its text, its theory. */
import { Comparison } from "../compare";
import { check, choice, h, ICONS, iconButton, type Page, saveAs, say, show, svg } from "../dom";
import type { Editor } from "../editor";
import { EngineError } from "../engine/client";
import type { Cure, SceneInfo, Value } from "../engine/protocol";
import { FamilySwitches } from "../families";
import { want } from "../files";
import { FAMILIES, familiesOf } from "../links";
import { Panel } from "../panel";
import { type Curve, legend, Plot } from "../plot";
import { pointers } from "../pointer";
import { saving } from "../saving";
import { beside, titleOf } from "../scenes";
import { engine } from "../session";
import { addressOf } from "../share";
import { begin, type Source, source, toShare } from "../source";
import { cards, topics } from "../theory";
import { transport } from "../transport";
import { literal, valueIn } from "../values";
import { gridsOf, massesOf } from "../view/scenery";
import { reducedMotion, Viewer } from "../viewer";

/** Columns of grids that can be shown, and how they are called. */
const FIELDS: [string, string][] = [
  ["density", "Density"],
  ["temperature", "Temperature"],
  ["pressure", "Pressure"],
  ["speed", "Speed"],
  ["vorticity", "Vorticity"],
  ["divergence", "Divergence"],
  ["fuel", "Fuel"],
];

/** Values that only say how a scene starts: a world that goes on would never look at them. */
const STARTS = /^(galaxy\.|particles\.\d+\.(position|velocity|cloud)|(sheet|block)\.\d+\.(center|rotate))/;

export const page: Page = async (main, rest) => {
  let start: Source;
  try {
    start = await source(rest);
  } catch (error) {
    document.title = "tumble";
    main.append(
      h(
        "div",
        { class: "narrow" },
        h("h1", {}, "The scene cannot be opened"),
        h("p", {}, String((error as Error).message ?? error)),
        h("p", {}, h("a", { href: "#/" }, "To the gallery")),
      ),
    );
    return () => {};
  }

  // Left before its text came.
  if (!main.isConnected) return () => {};

  const viewer = new Viewer(
    main,
    "Picture of the scene. Space plays and pauses, comma and period step by frames, semicolon by sub-steps, arrows rotate the view, plus and minus zoom, 0 resets the view.",
    true,
    (failure) => {
      if (failure.kind !== "step") return null;
      const button: HTMLButtonElement = h(
        "button",
        { type: "button", class: "button", onclick: () => void cures(button) },
        "Search for a cure",
      );
      return button;
    },
  );
  const { session, stage, canvas, alert } = viewer;
  session.each = session.compares = true;
  const sceneId = h("p", { class: "scene-id" }, start.id ?? start.name);
  const title = h("h1", {}, titleOf(start.text) || start.name);
  const lookBar = h("div", { class: "look", role: "group", "aria-label": "Display options" });
  const energyCurves: Curve[] = [
    { label: "kinetic", color: 1 },
    { label: "elastic", color: 2 },
    { label: "external", color: 3 },
    { label: "total", color: 0, width: 2.25 },
    { label: "total, previous branch", color: 0, dash: [4, 4], width: 1.25 },
  ];
  const energy = new Plot(energyCurves, {
    label: "Energies against time",
    x: "time [s]",
    height: 140,
    mark: () => session.shown?.time ?? null,
  });
  const energyKey = legend(energyCurves);
  const hashBox = h("output", { class: "hash", "aria-label": "State hash" }, "–");
  const facts = h("dl", { class: "facts" });

  // The side: values, text, theory.
  const valuesTab = h("div", { id: "tab-values", role: "tabpanel", "aria-labelledby": "t-values" });
  const editorBox = h("div", { class: "editor" });
  const issuesBox = h("ul", { class: "issues" });
  const textTab = h("div", { id: "tab-text", role: "tabpanel", "aria-labelledby": "t-text", hidden: true, class: "text-tab" });
  const theoryTab = h("div", { id: "tab-theory", role: "tabpanel", "aria-labelledby": "t-theory", hidden: true });
  const factsTab = h("div", { id: "tab-facts", role: "tabpanel", "aria-labelledby": "t-facts", hidden: true }, facts);
  const tabs: [string, string, HTMLElement][] = [
    ["values", "Values", valuesTab],
    ["text", "Text", textTab],
    ["theory", "Theory", theoryTab],
    ["facts", "Facts", factsTab],
  ];
  const buttons = tabs.map(([id, label], k) =>
    h(
      "button",
      {
        id: `t-${id}`,
        type: "button",
        role: "tab",
        "aria-selected": k === 0 ? "true" : "false",
        "aria-controls": `tab-${id}`,
        tabindex: k === 0 ? 0 : -1,
        onclick: () => choose(k),
        onkeydown: (event: KeyboardEvent) => {
          const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
          if (step) choose((k + step + tabs.length) % tabs.length, true);
        },
      },
      label,
    ),
  );
  const choose = (k: number, focus = false) => {
    tabs.forEach(([, , panel], i) => {
      panel.hidden = i !== k;
      buttons[i].setAttribute("aria-selected", String(i === k));
      buttons[i].tabIndex = i === k ? 0 : -1;
    });
    if (focus) buttons[k].focus();
    if (tabs[k][0] === "text") void openEditor();
    if (tabs[k][0] === "facts") void tellFacts();
  };

  const others = start.id ? beside(start.id) : [];
  const shareButton = h("button", { type: "button", class: "button", onclick: () => void share() }, svg(ICONS.share, 16), "Copy link");
  const saved = saving(session, stage, start.name);
  const comparison = new Comparison(session, stage, viewer.tellLegend);
  main.append(
    h(
      "div",
      { class: "lab" },
      h(
        "section",
        { class: "view", "aria-label": "Simulation" },
        h(
          "div",
          { class: "lab-head" },
          h("div", {}, title, sceneId),
          h(
            "div",
            { class: "actions" },
            shareButton,
            ...saved.buttons,
            iconButton("frame", "Reset to the scene's camera", () => stage.goHome()),
          ),
        ),
        alert,
        others.length > 1
          ? h(
              "nav",
              { class: "others", "aria-label": "Similar scenes" },
              ...others.map((s) =>
                h("a", { href: `#/scene/${s.id}`, "aria-current": s.id === start.id ? "page" : false }, s.name.replace(/[_-]/g, " ")),
              ),
            )
          : null,
        viewer.box,
        transport(session),
        lookBar,
        comparison.bar,
        h(
          "div",
          { class: "books" },
          h("div", { class: "energy" }, h("h2", {}, "Energy", h("span", { class: "unit" }, "J")), energyKey.element, energy.element),
          comparison.chart,
        ),
        h(
          "p",
          { class: "hash-line" },
          "State hash ",
          hashBox,
          h("span", { class: "muted" }, " identical on every machine, in a tab and on the command line"),
        ),
      ),
      h(
        "aside",
        { class: "side", "aria-label": "The scene" },
        h("div", { class: "tabs", role: "tablist", "aria-label": "The scene" }, ...buttons),
        ...tabs.map((t) => t[2]),
      ),
    ),
  );

  main.querySelector(".others [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" });

  // The picture follows the world.
  let hashWait = 0;
  /** A shared scene, until it is changed. */
  let recipe = "";
  const origin = rest.startsWith("s/") ? "link" : "file";
  const tellHash = () => {
    clearTimeout(hashWait);
    hashWait = window.setTimeout(async () => {
      if (session.playing || session.shown?.index !== session.latest) return;
      const at = session.latest;
      const hash = await session.hash().catch(() => null);
      if (hash && at === session.latest && !session.playing) {
        hashBox.textContent = hash;
        hashBox.dataset.frame = String(at);
        if (start.shared?.hash && start.shared.frame === at && session.recipe === recipe) {
          const same = start.shared.hash === hash;
          hashBox.append(
            h("span", { class: same ? "good" : "bad" }, same ? ` as in the ${origin}` : ` the ${origin} says ${start.shared.hash}`),
          );
        }
      }
    }, 120);
  };
  const drawEnergy = () => {
    const books = session.ledgers;
    const external0 = books[0]?.external ?? 0;
    const dt = session.info?.dt ?? 1;
    const count = Math.max(books.length, Math.round(comparison.end / dt) + 1);
    const times = Array.from({ length: count }, (_, i) => books[i]?.time ?? i * dt);
    const pad = (list: (number | null)[]) => times.map((_, i) => (Number.isFinite(list[i]) ? list[i] : null));
    const old = comparison.energies(times);
    energy.set([
      times,
      pad(books.map((l) => l.kinetic)),
      pad(books.map((l) => l.elastic)),
      pad(books.map((l) => l.external - external0)),
      pad(books.map((l) => l.energy - external0)),
      old,
    ]);
    (energyKey.element.lastElementChild as HTMLElement).hidden = !session.before;
    const now = session.shown?.inside ? session.shown.ledgers[0] : books[session.shown?.index ?? books.length - 1];
    if (now)
      energyKey.set([
        show(now.kinetic, 3),
        show(now.elastic, 3),
        show(now.external - external0, 3),
        show(now.energy - external0, 3),
        show(old[session.shown?.index ?? 0], 3),
      ]);
  };
  let opening = true;
  session.on("loaded", (info) => {
    stage.open(info, comparison.past, !opening);
    opening = false;
    drawLook(info);
    panel?.open(info, session.toml, session.overrides);
    switches.open(info, session.toml);
    title.textContent = info.title || start.name;
    document.title = `${info.title || start.name} · tumble`;
    viewer.box.classList.toggle("night", stage.night);
    hashBox.textContent = info.hash;
    hashBox.dataset.frame = String(session.latest);
    void cards(topics(info)).then((made) => theoryTab.replaceChildren(...made));
    void tellLimits();
    void tellFacts();
  });
  session.on("changed", (info) => {
    stage.changed(info);
    panel?.open(info, session.toml, session.overrides);
    void tellLimits();
    switches.open(info, session.toml);
  });
  session.on("frame", (frame) => {
    comparison.show(frame);
    drawEnergy();
    tellHash();
  });
  session.on("before", () => drawEnergy());
  session.on("playing", (on) => {
    if (on) alert.hidden = true;
    else tellHash();
  });
  const cures = async (button: HTMLButtonElement) => {
    button.disabled = true;
    button.textContent = "Trying changes from the last good frame …";
    try {
      const found: Cure[] = await engine().cures(session.world);
      const good = found.filter((c) => c.survived);
      button.replaceWith(
        h(
          "ul",
          { class: "cures" },
          ...(good.length ? good : found).map((c) => {
            // One or more, with blanks between: "system.0.integrator=rk4 system.0.substeps=161".
            const changes = c.set
              .split(/ (?=[\w.]+=)/)
              .map((one): [string, Value] => [one.slice(0, one.indexOf("=")), valueIn(one.slice(one.indexOf("=") + 1))]);
            const act = () => {
              alert.hidden = true;
              void session.load(session.toml, [...session.overrides, ...changes]).then(() => {
                if (editor) syncText();
                session.play();
              });
            };
            return h(
              "li",
              {},
              h("code", {}, c.set),
              c.survived ? h("button", { type: "button", class: "button", onclick: act }, "Apply and restart") : " does not help",
            );
          }),
        ),
      );
    } catch (error) {
      button.replaceWith(h("p", {}, String((error as Error).message)));
    }
  };

  // Values.
  let panel: Panel | null = null;
  /** What was last not found, and in how long [ms]. */
  let missed = { toml: "", budget: 0 };
  /** Finding stable steps keeps the engine from its frames: for a moment while they play, for longer while nobody waits. */
  const tellLimits = async () => {
    const { toml } = session;
    for (const budget of session.playing ? [250] : [250, 4000]) {
      if (!panel || (missed.toml === toml && missed.budget >= budget)) continue;
      const start = performance.now();
      const list = await session.stability(budget).catch(() => []);
      if (session.toml !== toml) return;
      panel.limits(list);
      if (list.length || performance.now() - start < budget) return;
      missed = { toml, budget };
    }
  };
  const change = async (path: string, value: Value, what = `${path} = ${literal(value)}`) => {
    try {
      if (STARTS.test(path)) {
        await session.load(session.toml, [...session.overrides, [path, value]]);
        alert.hidden = true;
        panel?.say(`${what}: affects the initial state, so the scene restarts.`);
        if (editor) syncText();
        return;
      }
      const live = await session.set(path, value);
      alert.hidden = true;
      panel?.say(
        live
          ? `${what}: continues from frame ${session.latest}; the previous branch is kept for comparison.`
          : `${what}: sizes have changed, so the scene restarts.`,
      );
      if (editor) syncText();
    } catch (error) {
      if (error instanceof EngineError) {
        panel?.say(error.failure.message.split("\n").slice(0, 3).join(" "), true);
        if (!session.info) return;
        panel?.open(session.info, session.toml, session.overrides);
        switches.open(session.info, session.toml);
      } else throw error;
    }
  };

  const switches = new FamilySwitches(change);
  valuesTab.append(switches.element);

  // Text.
  let editor: Editor | null = null;
  let making: Promise<void> | null = null;
  const run = h("button", { type: "button", class: "button primary", onclick: () => void apply() }, "Run");
  const changedNote = h("p", { class: "note" });
  const syncText = () => {
    const list = [...session.overrides].map(([p, v]) => `${p} = ${literal(v)}`);
    changedNote.textContent = list.length ? `Changed in the panel, in addition to the text: ${list.join("; ")}` : "";
  };
  textTab.append(h("div", { class: "text-head" }, run, h("span", { class: "muted" }, "Ctrl + Enter")), editorBox, issuesBox, changedNote);
  const openEditor = () =>
    (making ??= (async () => {
      const { Editor: Made } = await import("../editor");
      editor = new Made(editorBox, () => void apply());
      editor.text = session.toml || start.text;
      syncText();
    })());
  const apply = async () => {
    if (!editor) return;
    const text = editor.text;
    run.disabled = true;
    const was = session.playing;
    session.pause();
    try {
      await session.load(text);
      editor.issues([]);
      issuesBox.replaceChildren();
      alert.hidden = true;
      syncText();
    } catch (error) {
      if (!(error instanceof EngineError)) throw error;
      const { failure } = error;
      want(failure.missing ?? [], () => void apply());
      viewer.complain(failure);
      editor.issues(failure.issues);
      issuesBox.replaceChildren(
        ...failure.issues.map((i) =>
          h(
            "li",
            {},
            i.line ? h("button", { type: "button", class: "line", onclick: () => editor?.goto(i.line!) }, `Line ${i.line}`) : null,
            h("span", {}, `${i.path ? `${i.path}: ` : ""}${i.message}`),
          ),
        ),
      );
    } finally {
      run.disabled = false;
      if (was) session.play();
    }
  };

  // Facts.
  const tellFacts = async () => {
    const info = session.info;
    if (!info || factsTab.hidden) return;
    const rows: [string, string][] = [
      ["Frames", `${info.frames}, ${show(info.fps)} for each second of the scene's time`],
      ["Precision", info.precision],
      ["Objects", info.objects.map((o) => `${o.name} (${o.kind})`).join(", ")],
      ["Systems", info.systems.map((s) => `${s.name}: ${[...new Set([s.method, s.integrator])].filter(Boolean).join(", ")}`).join("; ")],
      ["Memory limit", `${show(info.memory / 2 ** 20, 3)} MiB`],
    ];
    const report = session.report;
    if (report)
      rows.push([
        "Last frame",
        `${report.steps} steps, ${report.newton} Newton and ${report.linear} linear iterations, ${report.sweeps} sweeps`,
      ]);
    const body: HTMLElement[] = rows.flatMap(([k, v]) => [h("dt", {}, k), h("dd", {}, v)]);
    if (info.warnings.length)
      body.push(
        h("dt", {}, "Warnings"),
        h("dd", {}, info.warnings.map((w) => `${w.path ? `${w.path}: ` : ""}${w.message} [${w.code}]`).join("\n")),
      );
    facts.replaceChildren(...body);
    const list = await session.stability().catch(() => []);
    const found = new Set(list.map((s) => s.system));
    for (const s of info.systems) {
      if (s.method === "dynamics" && !found.has(s.name))
        facts.append(h("dt", {}, `Largest steps of "${s.name}"`), h("dd", {}, "take too long to compute here; use `tumble check`"));
    }
    const stable = list.filter((s) => s.limits.length);
    for (const s of stable) {
      facts.append(
        h("dt", {}, `Largest steps of "${s.system}"`),
        h(
          "dd",
          {},
          h("p", {}, `now ${s.integrator.replace(/_/g, " ")}, ${show(s.step, 3)} s; stiffest mode ${show(s.frequency, 3)} rad/s`),
          h(
            "div",
            { class: "scroll", tabindex: 0 },
            h(
              "table",
              {},
              h(
                "thead",
                {},
                h(
                  "tr",
                  {},
                  h("th", { scope: "col" }, "integrator"),
                  h("th", { scope: "col" }, "stable [s]"),
                  h("th", { scope: "col" }, "usable [s]"),
                ),
              ),
              h(
                "tbody",
                {},
                ...s.limits.map((l) =>
                  h(
                    "tr",
                    { class: l.integrator === s.integrator ? "now" : false },
                    h("th", { scope: "row" }, l.integrator.replace(/_/g, " ")),
                    h("td", {}, l.stable === null ? "any" : l.stable === 0 ? "none" : show(l.stable, 3)),
                    h("td", {}, l.usable === null ? "any" : l.usable === 0 ? "none" : show(l.usable, 3)),
                  ),
                ),
              ),
            ),
          ),
        ),
      );
    }
  };

  // Display options.
  const drawLook = (info: SceneInfo) => {
    const look = stage.look;
    const grids = gridsOf(info);
    const masses = massesOf(info).length > 0;
    const again = () => {
      void session.refresh().then(() => comparison.again());
      comparison.again();
    };
    const parts: HTMLElement[] = [];
    if (grids.length) {
      const kinds = new Set(grids.map((g) => g.kind));
      const scene = info.scene as Record<string, any>;
      const gas = (scene.gas ?? [])[0];
      const there = FIELDS.filter(([name]) => {
        if (kinds.has("gas"))
          return name === "density" ? gas?.smoke : name === "temperature" ? gas?.temperature : name === "fuel" ? gas?.fire : true;
        if (kinds.has("heat")) return name === "temperature";
        return ["density", "speed", "vorticity"].includes(name);
      });
      parts.push(
        choice("Shown", [["", "by itself"], ...there], look.field ?? "", (v) => {
          look.field = v || null;
          again();
        }),
      );
      const space = info.dimension === 3;
      if (!space) {
        parts.push(
          check("Arrows", look.arrows, (on) => {
            look.arrows = on;
            again();
          }),
          check("Cells", look.cells, (on) => {
            look.cells = on;
            again();
          }),
        );
        if (gas?.smoke)
          parts.push(
            check("Dye", look.dye, (on) => {
              look.dye = on;
              again();
            }),
          );
      } else {
        const ruled = check("Cells", look.cells, (on) => {
          look.cells = on;
          comparison.again();
        });
        ruled.hidden = look.slice === null;
        const at = h("input", {
          type: "range",
          min: 0,
          max: 1,
          step: 0.005,
          value: look.sliceAt,
          "aria-label": "Position of the slice",
          hidden: look.slice === null,
          oninput: () => {
            look.sliceAt = Number(at.value);
            comparison.again();
          },
        });
        parts.push(
          choice(
            "See",
            [
              ["", "smoke"],
              ["0", "slice normal to x"],
              ["1", "slice normal to y"],
              ["2", "slice normal to z"],
            ],
            look.slice === null ? "" : String(look.slice),
            (v) => {
              look.slice = v === "" ? null : Number(v);
              at.hidden = ruled.hidden = look.slice === null;
              again();
            },
          ),
          at,
          ruled,
        );
      }
    }
    if (masses) {
      const linked = Object.values(info.topology).some((t) => t.links?.data.length);
      parts.push(
        choice(
          "Colour",
          [["object", "object"], ["speed", "speed"], ...(linked ? [["strain", "strain of links"] as [string, string]] : [])],
          look.color,
          (v) => {
            look.color = v as typeof look.color;
            again();
          },
        ),
      );
      if (linked) {
        const there = new Set(info.objects.flatMap((o) => [...(familiesOf(info, o) ?? [])]));
        const families = h(
          "span",
          { class: "sights", role: "group", "aria-label": "Families of links shown", hidden: !look.links },
          ...(there.size > 1 ? FAMILIES.filter((_, i) => there.has(i)) : []).map((f) =>
            check(f, !look.unseen.includes(f), (on) => {
              look.unseen = on ? look.unseen.filter((u) => u !== f) : [...look.unseen, f];
              again();
            }),
          ),
        );
        parts.push(
          check("Links", look.links, (on) => {
            look.links = on;
            families.hidden = !on;
            again();
          }),
          families,
        );
      }
      if (stage.trails)
        parts.push(
          check("Trails", look.trails, (on) => {
            look.trails = on;
            again();
          }),
        );
    }
    lookBar.replaceChildren(...parts);
  };

  const offPointers = pointers(canvas, stage, session);

  // Sharing and saving.
  const share = async () => {
    const { version } = engine();
    const made = await toShare(session, version).catch((error) => ({ failed: String(error.message ?? error) }));
    if ("failed" in made) return say(made.failed);
    const pulled = session.history.some((c) => !c.path) ? " What the pointer did is not in it: it begins at the first frame." : "";
    if ("file" in made) {
      saveAs(made.file, `${start.name}.tumble`);
      return say(`${made.reason}: it was saved as a file; drop it on this page to open it.${pulled}`);
    }
    const address = addressOf(version, made.link);
    main.dataset.link = address;
    try {
      await navigator.clipboard.writeText(address);
      say(`Link copied. It contains the scene with all values, its seed and the version.${pulled}`);
    } catch {
      history.replaceState(null, "", address);
      say(`The address of this page now contains the scene.${pulled}`);
    }
  };
  const theme = () => comparison.theme();
  addEventListener("themechange", theme);
  const makePanel = async () => {
    try {
      const made = new Panel(await engine().schema(), change);
      panel = made;
      valuesTab.append(made.element);
      if (session.info) made.open(session.info, session.toml, session.overrides);
      if (session.info) void tellLimits();
    } catch (error) {
      valuesTab.append(h("p", {}, String((error as Error).message)));
    }
  };
  void viewer
    .begin(async () => {
      const told = await begin(session, start, (i) => viewer.waiting(`frame ${i} of ${start.shared!.frame}`, () => session.stop()));
      recipe = session.recipe;
      if (start.shared) {
        const { version } = start.shared;
        const here = engine().version;
        sceneId.textContent = [
          `from a ${origin} of tumble ${version}`,
          version === here ? "" : `opened with ${here}: bits may differ`,
          told,
        ]
          .filter(Boolean)
          .join("; ");
      }
      // A shared moment opens at its frame, with its hash.
      if (start.shared?.hash) tellHash();
      else if (!reducedMotion()) session.play();
    })
    .then((failure) => {
      // After the scene, whose engine knows it, too.
      void makePanel();
      if (!failure) return;
      want(failure.missing ?? [], () => dispatchEvent(new Event("hashchange")));
      choose(1);
      void openEditor().then(() => editor?.issues(failure.issues));
    });

  // For tests and for the curious.
  Object.assign(window, { tumble: { session, stage, comparison, engine: engine() } });

  return () => {
    want([]);
    removeEventListener("themechange", theme);
    offPointers();
    saved.close();
    energy.close();
    comparison.close();
    editor?.close();
    viewer.close();
  };
};
