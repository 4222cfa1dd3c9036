/** A fluid in a box, in a plane or in space, to stir: views of everything that a step makes, and a pressure that may be as bad as one likes. */
import { parse } from "smol-toml";
import { Vector3 } from "three";
import { asScene, asSceneButton, figure, slide } from "../demo";
import { check, choice, h, iconButton, type Page, show } from "../dom";
import type { Value, Vector } from "../engine/protocol";
import { isDark, Plot } from "../plot";
import { pointers } from "../pointer";
import { pictureButton } from "../saving";
import { cards } from "../theory";
import { transport } from "../transport";
import { literal } from "../values";
import { reducedMotion, Viewer } from "../viewer";

const VIEWS: [string, string][] = [
  ["density", "Dye"],
  ["pressure", "Pressure"],
  ["speed", "Speed with arrows"],
  ["vorticity", "Vorticity"],
  ["divergence", "Residual divergence"],
];
const SOLVERS: [string, string][] = [
  ["jacobi", "Jacobi"],
  ["gauss_seidel", "Red-black Gauss–Seidel"],
  ["sor", "Over-relaxation"],
  ["conjugate_gradients", "Conjugate gradients"],
  ["incomplete_cholesky", "… with incomplete Cholesky"],
  ["modified_incomplete_cholesky", "… with MIC(0)"],
  ["multigrid", "Multigrid"],
  ["multigrid_gradients", "Multigrid gradients"],
  ["cosine", "Cosine transform"],
];
const OBSTACLES: Record<string, string> = {
  none: "",
  disk: `[[collider]]\nname = "disk"\nshape = { sphere = { center = [-0.25, 0, 0], radius = 0.1 } }\n`,
  gate: `[[collider]]\nname = "upper"\nshape = { box = { center = [0, 0, 0.29], size = [0.05, 1, 0.32] } }\n\n[[collider]]\nname = "lower"\nshape = { box = { center = [0, 0, -0.29], size = [0.05, 1, 0.32] } }\n`,
  posts: [-0.3, -0.1, 0.1, 0.3]
    .map(
      (z, i) =>
        `[[collider]]\nname = "post ${i + 1}"\nshape = { sphere = { center = [${i % 2 ? 0.12 : -0.12}, 0, ${z}], radius = 0.055 } }\n`,
    )
    .join("\n"),
};

interface Choices {
  cells: number;
  method: string;
  iterations: number;
  tolerance: number;
  viscosity: number;
  confinement: number;
  advection: "linear" | "corrected" | "cubic";
  order: "project_last" | "reflection";
  obstacle: string;
  particles: boolean;
  lifetime: number;
  trail: number;
  /** In space a slice is shown, or all of the smoke. */
  space: "plane" | "slice" | "smoke";
  /** Drawn by hand, in the plane: points. */
  walls: [number, number][][];
}

const START: Choices = {
  cells: 192,
  method: "multigrid_gradients",
  iterations: 100,
  tolerance: 1e-3,
  viscosity: 0,
  confinement: 0,
  advection: "corrected",
  order: "project_last",
  obstacle: "none",
  particles: true,
  lifetime: 3,
  trail: 0.3,
  space: "plane",
  walls: [],
};

const CARRIED = {
  linear: '{ interpolation = "linear" }',
  corrected: "{ corrected = true }",
  cubic: '{ interpolation = "monotone_cubic", corrected = true }',
};

/** Straight pieces of walls that were drawn. */
const pieces = (c: Choices) =>
  c.walls.flatMap((wall, k) =>
    wall.slice(1).map(([x, z], i) => ({
      name: `wall ${k + 1}.${i + 1}`,
      shape: { capsule: { from: [wall[i][0], 0, wall[i][1]], to: [x, 0, z], radius: 0.018 } },
    })),
  );

/** All solids, as a list of the scene. */
const solids = (c: Choices) => [...((parse(OBSTACLES[c.obstacle]).collider ?? []) as Value[]), ...pieces(c)];

/** Cells along, and how deep the box is, in space [m]. */
const SPACE = { cells: ["48", "64", "96", "128"], depth: 0.5 };
const PLANE = ["64", "96", "128", "192", "256", "384"];

const scene = (c: Choices) => `version = 1
title = "A fluid to stir"
dimension = ${c.space === "plane" ? 2 : 3}

[time]
fps = 60
frames = 100_000_000

[[system]]
name = "flow"
method = "gas"
substeps = 1
${c.particles ? '\n[[system]]\nname = "dust"\nmethod = "tracers"\nintegrator = "heun"\nsubsteps = 1\n' : ""}
[[gas]]
name = "fluid"
box = { size = [1.6, ${c.space === "plane" ? 1 : SPACE.depth}, 0.9], resolution = ${c.cells} }
fluid_density = 1
${c.viscosity > 0 ? `viscosity = ${c.viscosity}\n` : ""}confinement = ${c.confinement}
velocity = ["1.1*exp(-60*((z - 0.1)^2)) - 1.1*exp(-60*((z + 0.1)^2))", ${c.space === "plane" ? 0 : '"0.1*sin(5*x)*cos(9*y)"'}, "0.25*sin(8*x)*exp(-20*z^2)"]
smoke = { initial = "0.9*smoothstep(0.02, -0.02, abs(abs(z) - 0.12) - 0.05)", weight = 0, dissipation = 0.04 }
order = "${c.order}"
advection = { velocity = ${CARRIED[c.advection]} }
pressure = { method = "${c.method}", iterations = ${c.iterations}, tolerance = ${c.tolerance} }
${
  c.particles
    ? `
[[emitter]]
name = "dust"
system = "dust"
from = { box = { size = [1.6, ${c.space === "plane" ? 0 : SPACE.depth}, 0.9] } }
rate = ${Math.round(1500 / c.lifetime)}
lifetime = ${c.lifetime}
lifetime_spread = 0.4
jitter = 1
radius = 0.0012
trail = ${c.trail}
color = ${isDark() ? "[0.75, 0.8, 0.85]" : "[0.02, 0.04, 0.08]"}

[[field]]
kind = "gas"
of = "fluid"
`
    : ""
}
${OBSTACLES[c.obstacle]}
${pieces(c)
  .map((w) => `[[collider]]\nname = "${w.name}"\nshape = ${literal(w.shape)}\n`)
  .join("\n")}
${c.space === "plane" ? "" : `[camera]\nposition = ${c.space === "slice" ? "[0, -2.9, 0]" : "[1.2, -2.9, 0.95]"}\ntarget = [0, 0, 0]\n`}
[output]
columns = ["position", "density"]
`;

export const page: Page = async (main) => {
  document.title = "Fluid · tumble";
  const choices: Choices = { ...START };
  let drawing = false;
  const viewer = new Viewer(
    main,
    "The fluid. Move the pointer to stir, drag to add dye; with the keyboard, arrows stir around the ring, space plays.",
    false,
  );
  const { session, stage, canvas } = viewer;
  session.endless = true;
  stage.look.field = "density";
  const ring = h("div", { class: "ring", hidden: true });
  viewer.box.classList.add("stirs");
  viewer.box.append(ring);
  const energy = new Plot([{ label: "kinetic energy", color: 0, width: 2 }], {
    label: "Kinetic energy against time",
    x: "time [s]",
    height: 130,
  });
  const residual = new Plot([{ label: "residual", color: 1, width: 2 }], {
    label: "Residual of the pressure per iteration, on a logarithmic scale",
    x: "iteration",
    log: true,
    height: 130,
  });
  const figures = {
    left: figure("Divergence", "residual"),
    iterations: figure("Iterations", "iterations"),
    cost: figure("Engine time per step"),
    courant: figure("Courant number"),
    kinetic: figure("Kinetic energy"),
  };
  const advice = h("p", { class: "doc", role: "status" });

  const rerun = async () => {
    if (!(await viewer.attempt(() => session.load(scene(choices))))) session.play();
  };
  const set = async (path: string, value: Value) => {
    if (!(await viewer.attempt(() => session.set(path, value)))) session.play();
  };

  const view = choice("View", VIEWS, "density", (v) => showView(v));
  view.querySelector("select")!.id = "view";
  const showView = (v: string) => {
    const space = choices.space !== "plane";
    stage.look.field = v;
    arrowsShown.querySelector("input")!.checked = stage.look.arrows = v === "speed" && !space;
    stage.look.dye = v === "density";
    // Only smoke can be looked through.
    stage.look.slice = choices.space === "slice" || (space && v !== "density") ? 1 : null;
    // The pressure and its like are one number for each cell.
    showCells(v !== "density");
    void session.refresh().then(() => {
      stage.again();
      viewer.tellLegend();
    });
  };
  const cellsShown = check("Cells", false, (on) => {
    stage.look.cells = on;
    stage.again();
  });
  const arrowsShown = check("Arrows", false, (on) => {
    stage.look.arrows = on;
    void session.refresh().then(() => stage.again());
  });
  const showCells = (on: boolean) => {
    cellsShown.querySelector("input")!.checked = stage.look.cells = on;
    // Smoke in space is looked through.
    cellsShown.hidden = choices.space !== "plane" && stage.look.slice === null;
  };
  const cells = choice("Cells along", [], "", (v) => {
    choices.cells = Number(v);
    void rerun();
  });
  const fillCells = () => {
    const list = choices.space === "plane" ? PLANE : SPACE.cells;
    if (!list.includes(String(choices.cells))) choices.cells = choices.space === "plane" ? START.cells : 64;
    cells.querySelector("select")!.replaceChildren(...list.map((n) => h("option", { value: n, selected: n === String(choices.cells) }, n)));
  };
  fillCells();
  const sliceAt = slide(
    "Position of the slice",
    0,
    1,
    0.5,
    (v) => `${show((v - 0.5) * SPACE.depth, 2)} m`,
    (v) => {
      stage.look.sliceAt = v;
      stage.again();
    },
  );
  sliceAt.hidden = true;
  const dragging = choice(
    "Dragging",
    [
      ["stir", "stirs"],
      ["draw", "draws walls"],
    ],
    "stir",
    (v) => (drawing = v === "draw"),
  );
  const clear = h(
    "button",
    {
      type: "button",
      class: "button",
      onclick: () => {
        choices.walls = [];
        void set("collider", solids(choices) as Value);
      },
    },
    "Remove the walls",
  );
  const space = choice(
    "Fluid",
    [
      ["plane", "2D"],
      ["slice", "3D, slice"],
      ["smoke", "3D, smoke"],
    ],
    choices.space,
    (v) => {
      choices.space = v as Choices["space"];
      const plane = v === "plane";
      // Walls are drawn in a plane.
      if (!plane) choices.walls = [];
      for (const part of [dragging, clear, arrowsShown]) part.hidden = !plane;
      sliceAt.hidden = plane;
      if (!plane && drawing) {
        drawing = false;
        dragging.querySelector("select")!.value = "stir";
      }
      fillCells();
      showView(view.querySelector("select")!.value);
      void rerun();
    },
  );
  space.querySelector("select")!.id = "space";
  const power = (low: number, high: number) => ({ of: (v: number) => (v <= low ? 0 : 10 ** v), low, high });
  const thick = power(-6, -1.5);
  const controls = h(
    "div",
    { class: "controls" },
    h(
      "section",
      { class: "card" },
      h("h2", {}, "Pressure"),
      choice("Solver", SOLVERS, choices.method, (v) => {
        choices.method = v;
        void set("gas.0.pressure.method", v);
      }),
      slide(
        "Maximum iterations",
        0,
        3,
        Math.log10(choices.iterations),
        (v) => String(Math.round(10 ** v)),
        (v) => {
          choices.iterations = Math.round(10 ** v);
          void set("gas.0.pressure.iterations", choices.iterations);
        },
      ),
      slide(
        "Tolerance",
        -6,
        -1,
        Math.log10(choices.tolerance),
        (v) => show(Number((10 ** v).toPrecision(1)), 1),
        (v) => {
          choices.tolerance = Number((10 ** v).toPrecision(1));
          void set("gas.0.pressure.tolerance", choices.tolerance);
        },
      ),
      h("p", { class: "muted plot-title" }, "Relative residual by iteration"),
      residual.element,
      h("div", { class: "figures" }, figures.left.row, figures.iterations.row),
      advice,
    ),
    h(
      "section",
      { class: "card" },
      h("h2", {}, "Fluid"),
      choice(
        "Advection",
        [
          ["linear", "linear interpolation"],
          ["corrected", "MacCormack correction"],
          ["cubic", "cubic with correction"],
        ],
        choices.advection,
        (v) => {
          choices.advection = v as Choices["advection"];
          void set(
            "gas.0.advection.velocity",
            v === "linear"
              ? { interpolation: "linear", corrected: false }
              : v === "corrected"
                ? { interpolation: "linear", corrected: true }
                : { interpolation: "monotone_cubic", corrected: true },
          );
        },
      ),
      h(
        "p",
        { class: "doc" },
        "Each step reads values at the point where the fluid came from. Linear interpolation smooths them like a viscosity: watch the kinetic energy.",
      ),
      choice(
        "Step",
        [
          ["project_last", "first order: projection at its end"],
          ["reflection", "second order: reflection in its middle"],
        ],
        choices.order,
        (v) => {
          choices.order = v as Choices["order"];
          void set("gas.0.order", v);
        },
      ),
      h(
        "p",
        { class: "doc" },
        "A projection removes what advection has turned out of the flows without divergence, and with it energy. A reflection turns it back in, for the cost of two steps.",
      ),
      slide(
        "Viscosity [Pa s]",
        thick.low,
        thick.high,
        thick.low,
        (v) => show(thick.of(v), 2),
        (v) => {
          choices.viscosity = thick.of(v);
          void set("gas.0.viscosity", choices.viscosity);
        },
      ),
      slide(
        "Vorticity confinement",
        0,
        1,
        0,
        (v) => show(v, 2),
        (v) => {
          choices.confinement = v;
          void set("gas.0.confinement", v);
        },
      ),
      space,
      sliceAt,
      cells,
      choice(
        "Obstacles",
        [
          ["none", "none"],
          ["disk", "a disk"],
          ["gate", "a gate"],
          ["posts", "posts"],
        ],
        choices.obstacle,
        (v) => {
          choices.obstacle = v;
          void set("collider", solids(choices) as Value);
        },
      ),
      dragging,
      clear,
    ),
    h(
      "section",
      { class: "card" },
      h("h2", {}, "Particles"),
      check("Tracer particles", choices.particles, (on) => {
        choices.particles = on;
        void rerun();
      }),
      slide(
        "Lifetime [s]",
        0.5,
        8,
        choices.lifetime,
        (v) => show(v, 2),
        (v) => {
          choices.lifetime = v;
          void rerun();
        },
      ),
      slide(
        "Trail length [s]",
        0,
        1,
        choices.trail,
        (v) => show(v, 2),
        (v) => {
          choices.trail = v;
          void rerun();
        },
      ),
    ),
  );
  const theory = h("section", { class: "beside", "aria-label": "Theory" });
  main.append(
    h(
      "div",
      { class: "lab" },
      h(
        "section",
        { class: "view", "aria-label": "Fluid" },
        h(
          "div",
          { class: "lab-head" },
          h("div", {}, h("h1", {}, "A fluid to stir"), h("p", { class: "muted" }, "Move the pointer to stir it; drag to add dye.")),
          h(
            "div",
            { class: "actions" },
            view,
            cellsShown,
            arrowsShown,
            pictureButton(stage, () => "fluid"),
            iconButton("reset", "Restart with these settings", () => void rerun()),
            asSceneButton(() => asScene(scene(choices), 900)),
          ),
        ),
        viewer.alert,
        viewer.box,
        transport(session),
        h(
          "div",
          { class: "energy" },
          h("h2", {}, "Kinetic energy", h("span", { class: "unit" }, "J")),
          h("div", { class: "figures in-line" }, figures.kinetic.row, figures.courant.row, figures.cost.row),
          energy.element,
        ),
      ),
      h("aside", { class: "side scrolls", "aria-label": "Settings", tabindex: 0 }, controls),
      theory,
    ),
  );

  let book = 0;
  session.on("loaded", (info) => {
    stage.open(info, session.frame);
    session.each = stage.trails;
  });
  session.on("frame", (frame) => {
    stage.show(frame);
    viewer.tellLegend();
    const report = session.report;
    const ledger = session.ledgers[frame.index];
    if (ledger) figures.kinetic.value.textContent = `${show(ledger.kinetic, 3)} J`;
    figures.cost.value.textContent = `${show(session.cost, 2)} ms`;
    if (report) {
      figures.courant.value.textContent = show(report.courant, 2);
      const list = report.pressure;
      figures.left.value.textContent = show(report.residual, 2);
      figures.left.value.classList.toggle("bad", report.unconverged > 0);
      figures.iterations.value.textContent = String(report.linear);
      if (performance.now() - book > 150) {
        book = performance.now();
        residual.set([
          [0, ...list.map((_, i) => i + 1)],
          [1, ...list.map((r) => (r > 0 ? r : null))],
        ]);
        advice.textContent = report.unconverged
          ? "The pressure has not met its tolerance. The residual divergence makes the fluid expand and contract: see its view."
          : "Largest divergence times the cell size, relative to the fastest velocity; bounded by the tolerance.";
        const books = session.ledgers.slice(Math.max(0, session.ledgers.length - 1200));
        energy.set([books.map((l) => l.time), books.map((l) => l.kinetic)]);
      }
    }
    // A demo without an end keeps no past.
    session.trim(90);
  });

  // Walls, one for each stroke.
  let stroke: [number, number][] | null = null;
  const inside = (p: Vector3): [number, number] => [
    Number(Math.min(Math.max(p.x, -0.78), 0.78).toFixed(3)),
    Number(Math.min(Math.max(p.z, -0.43), 0.43).toFixed(3)),
  ];
  const draw = (event: PointerEvent) => {
    if (!drawing) return;
    event.stopImmediatePropagation();
    const at = stage.under(event);
    if (!at) return;
    if (event.type === "pointerdown") {
      canvas.setPointerCapture(event.pointerId);
      stroke = [inside(at)];
    } else if (stroke && event.type === "pointermove") {
      const [x, z] = inside(at);
      const [px, pz] = stroke[stroke.length - 1];
      if (Math.hypot(x - px, z - pz) > 0.05 && stroke.length < 40) stroke.push([x, z]);
    } else if (stroke) {
      if (stroke.length > 1 && choices.walls.length < 12) {
        choices.walls.push(stroke);
        void set("collider", solids(choices) as Value);
      }
      stroke = null;
    }
  };
  for (const name of ["pointerdown", "pointermove", "pointerup", "pointercancel"] as const)
    canvas.addEventListener(name, draw, { capture: true });
  // After those that draw, which may keep an event from it.
  const offPointers = pointers(canvas, stage, session, { dye: () => 0.2, size: () => 1 / 24, hovers: true });

  // By keys: a ring that goes along.
  const cursor = new Vector3();
  const stir = (event: KeyboardEvent) => {
    const way: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const go = way[event.key];
    const gas = stage.stirred;
    if (!go || !gas) return;
    cursor.y = gas.through?.y ?? 0;
    event.preventDefault();
    event.stopPropagation();
    cursor.x = Math.min(Math.max(cursor.x + 0.03 * go[0], -0.78), 0.78);
    cursor.z = Math.min(Math.max(cursor.z + 0.03 * go[1], -0.43), 0.43);
    ring.hidden = false;
    const box = viewer.box.getBoundingClientRect();
    const scale = box.width / stage.width;
    ring.style.left = `${box.width / 2 + cursor.x * scale}px`;
    ring.style.top = `${box.height / 2 - cursor.z * scale}px`;
    void session.stir(gas.name, cursor.toArray() as Vector, [go[0] * 0.6, 0, go[1] * 0.6], stage.width / 24, 0.2).catch(() => {});
    if (!session.playing) session.play();
  };
  viewer.box.addEventListener("keydown", stir);
  void cards([
    { page: "gas", tags: ["gas.1", "gas.3", "gas.4", "gas.5"] },
    { page: "pressure", tags: ["pressure.1", "pressure.2"] },
  ]).then((made) => theory.replaceChildren(...made));
  void viewer
    .begin(() => session.load(scene(choices)))
    .then((failure) => {
      if (!failure && !reducedMotion()) session.play();
    });

  return () => {
    offPointers();
    energy.close();
    residual.close();
    viewer.close();
  };
};
