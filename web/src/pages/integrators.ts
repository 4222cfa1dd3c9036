/** One system under two to six integrators, side by side: energy, phase, error, and the step that each can take. */
import { asScene } from "../demo";
import { check, choice, h, iconButton, type Page, setIcon, show } from "../dom";
import { EngineError } from "../engine/client";
import type { Frame, Ledger, SceneInfo, Stability } from "../engine/protocol";
import { type Curve, curveColor, curveStyle, isDark, Plot } from "../plot";
import { engine } from "../session";
import { cards, SCHEMES } from "../theory";
import { ADAPTIVE, FOR_FIELDS, flowLimits, LECTURE, PREDICTED, SYSTEMS, W } from "./integrators-systems";

const plain = (scheme: string) =>
  scheme
    .replace(/_/g, " ")
    .replace("euler", "Euler")
    .replace("heun", "Heun")
    .replace("rk4", "RK4")
    .replace("verlet", "Verlet")
    .replace("dormand prince", "Dormand–Prince")
    .replace("bdf2", "BDF2")
    .replace(/^./, (c) => c.toUpperCase());

interface Run {
  world: number;
  scheme: string;
  info: SceneInfo | null;
  frame: Frame | null;
  n: number;
  quantity: (number | null)[];
  error: (number | null)[];
  path: [number, number][];
  first: number;
  dead: string;
  /** Steps that the scheme took, and the shortest [s]. */
  steps: number;
  shortest: number;
  canvas: HTMLCanvasElement;
  ratio: HTMLElement;
  verdict: HTMLElement;
  predicted: HTMLElement;
  card: HTMLElement;
}

export const page: Page = async (main) => {
  document.title = "Integrators · tumble";
  main.className = "lab-page";
  let system = "spring";
  let schemes = [...LECTURE[0][1].schemes];
  let step = LECTURE[0][1].h;
  let log = true;
  let playing = false;
  let speed = 1;
  let runs: Run[] = [];
  let limits: Stability["limits"] = [];
  let age = 0;
  let closed = false;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;

  const about = h("p", { class: "lead small" });
  const board = h("div", { class: "runs" });
  const alert = h("div", { class: "alert", role: "alert", hidden: true });
  const clock = h("output", { class: "clock", "aria-label": "Time", "aria-live": "off" }, "0 s");
  const play = iconButton("play", "Play", () => (playing ? pause() : start()), { class: "icon-button primary" });
  const curves = (): Curve[] => runs.map((r, k) => ({ label: plain(r.scheme), color: k, width: 2 }));
  const make = (label: string, log: boolean) => new Plot([], { label, x: "time [s]", log, height: 190 });
  let energy = make("Energy relative to the initial energy against time", log);
  const error = make("Distance from the exact solution against time", true);
  const energyTitle = h("h2", {}, "Energy");
  const energyBox = h(
    "div",
    { class: "chart" },
    h(
      "div",
      { class: "chart-head" },
      energyTitle,
      check("Logarithmic", log, (on) => {
        log = on;
        rescale();
      }),
    ),
    energy.element,
  );
  const phase = h("canvas", { class: "phase", role: "img", "aria-label": "Paths of all integrators and the exact path" });
  const phaseTitle = h("h2", {}, "Phase");
  const phaseBox = h("div", { class: "chart" }, h("div", { class: "chart-head" }, phaseTitle, h("span", { class: "muted axes" })), phase);
  const errorBox = h(
    "div",
    { class: "chart" },
    h("div", { class: "chart-head" }, h("h2", {}, "Error"), h("span", { class: "muted axes" }, "distance from the exact solution [m]")),
    error.element,
  );
  const stepOut = h("output", { id: "step" });
  const slider = h("input", {
    type: "range",
    min: 0,
    max: 1,
    step: 0.001,
    id: "h",
    "aria-label": "Step h",
    oninput: () => {
      const [low, high] = SYSTEMS[system].steps;
      step = Number((low * (high / low) ** Number(slider.value)).toPrecision(3));
      stepOut.textContent = `${show(step)} s`;
      slider.setAttribute("aria-valuetext", `${show(step)} seconds`);
      drawMarks();
      clearTimeout(timer);
      timer = window.setTimeout(() => void restart(), 200);
    },
  });
  let timer = 0;
  const marks = h("div", { class: "marks", "aria-hidden": "true" });
  const limitText = h("p", { class: "doc" });
  const which = choice(
    "System",
    Object.entries(SYSTEMS).map(([k, s]) => [k, s.name]),
    system,
    (v) => {
      system = v;
      const [low, high] = SYSTEMS[v].steps;
      step = Number(Math.sqrt(low * high).toPrecision(2));
      schemes = schemes.filter((s) => allowed(s));
      if (schemes.length < 2) schemes = ["forward_euler", "rk4"];
      void restart();
    },
  );
  const boxes = h("fieldset", { class: "schemes" }, h("legend", {}, "Integrators (two to six)"));
  const lecture = h(
    "ul",
    { class: "lecture", "aria-label": "Presets from the lecture" },
    ...LECTURE.map(([name, set], k) =>
      h(
        "li",
        {},
        h(
          "button",
          {
            type: "button",
            class: "button",
            "data-set": k,
            onclick: () => {
              ({ system, h: step } = set);
              schemes = [...set.schemes];
              which.querySelector("select")!.value = system;
              void restart();
            },
          },
          name,
        ),
      ),
    ),
  );
  const theory = h("section", { class: "beside", "aria-label": "Theory" });
  const note = h("p", { class: "note", role: "status" });

  main.append(
    h(
      "div",
      { class: "lab" },
      h(
        "section",
        { class: "view", "aria-label": "Runs" },
        h(
          "div",
          { class: "lab-head" },
          h("h1", {}, "Integrators side by side"),
          h(
            "div",
            { class: "actions" },
            play,
            iconButton("reset", "Back to the start", () => void restart()),
            choice(
              "Speed",
              [
                ["0.25", "0.25 ×"],
                ["1", "1 ×"],
                ["4", "4 ×"],
              ],
              "1",
              (v) => (speed = Number(v)),
            ),
            clock,
          ),
        ),
        about,
        lecture,
        alert,
        board,
        h("div", { class: "charts" }, energyBox, phaseBox, errorBox),
      ),
      h(
        "aside",
        { class: "side scrolls", "aria-label": "Settings", tabindex: 0 },
        h(
          "div",
          { class: "controls" },
          h(
            "section",
            { class: "card" },
            h("h2", {}, "System and step"),
            which,
            h(
              "div",
              { class: "slide" },
              h("div", { class: "slide-head" }, h("label", { for: "h" }, "Step h"), stepOut),
              slider,
              marks,
              limitText,
            ),
          ),
          h("section", { class: "card" }, boxes, note),
        ),
      ),
      theory,
    ),
  );

  const allowed = (scheme: string) => !SYSTEMS[system].field || FOR_FIELDS.has(scheme);

  const drawBoxes = () => {
    boxes.replaceChildren(
      boxes.firstElementChild!,
      ...Object.keys(SCHEMES)
        .filter(allowed)
        .map((s) => {
          const box = check(plain(s), schemes.includes(s), (on) => {
            const next = on ? [...schemes, s] : schemes.filter((x) => x !== s);
            if (next.length < 2 || next.length > 6) {
              note.textContent = "Select two to six.";
              (box.querySelector("input") as HTMLInputElement).checked = !on;
              return;
            }
            note.textContent = "";
            schemes = Object.keys(SCHEMES).filter((x) => next.includes(x));
            void restart();
          });
          return box;
        }),
    );
  };

  const openScene = (scheme: string) => asScene(SYSTEMS[system].toml(scheme, step), Math.max(1, Math.ceil(SYSTEMS[system].end / step)));

  const limitOf = (scheme: string) => limits.find((l) => l.integrator === scheme);
  const drawMarks = () => {
    const [low, high] = SYSTEMS[system].steps;
    slider.value = String(Math.log(step / low) / Math.log(high / low));
    stepOut.textContent = `${show(step)} s`;
    const placed = runs.flatMap((r, k) => {
      const limit = limitOf(r.scheme)?.usable;
      if (!limit) return [];
      const at = Math.log(limit / low) / Math.log(high / low);
      if (!(at >= 0 && at <= 1)) return [];
      return [
        h("i", {
          style: `left:calc(${at} * (100% - 1rem) + 0.5rem);background:${curveStyle(k)}`,
          title: `${plain(r.scheme)}: ${show(limit, 3)} s`,
        }),
      ];
    });
    marks.replaceChildren(...placed);
    const z = limits.length && system === "spring" ? `ω h = ${show(W * step, 3)}. ` : "";
    limitText.textContent =
      z +
      (placed.length
        ? "The marks are the largest usable steps, predicted from the stiffest mode: energy grows less than a thousandfold in a hundred periods."
        : "");
  };

  const judge = (scheme: string): string => {
    const limit = limitOf(scheme);
    if (ADAPTIVE.has(scheme)) return "adaptive";
    if (!limit) return SYSTEMS[system].field ? "" : "no prediction";
    if (limit.stable === null) return "stable for every step";
    if (step <= limit.stable * (1 + 1e-9)) return `stable below ${show(limit.stable, 3)} s`;
    if (limit.stable === 0 && (limit.usable === null || step <= limit.usable))
      return `grows slowly; usable below ${show(limit.usable, 3)} s`;
    return limit.stable === 0
      ? `no step is stable; usable below ${show(limit.usable, 3)} s`
      : `too long: stable below ${show(limit.stable, 3)} s`;
  };

  const quantityOf = (run: Run, ledger: Ledger | undefined, frame: Frame | null): number | null => {
    const s = SYSTEMS[system];
    if (s.field) {
      const x = frame?.columns[s.object]?.position?.data;
      return x ? Math.hypot(x[0], x[1], x[2]) : null;
    }
    if (!ledger) return null;
    return system === "sheet" ? ledger.energy - run.first + s.zero : ledger.energy + s.zero;
  };

  const restart = async () => {
    const own = ++age;
    const s = SYSTEMS[system];
    pause();
    about.textContent = s.about;
    which.querySelector("select")!.value = system;
    for (const button of lecture.querySelectorAll("button")) {
      const set = LECTURE[Number(button.dataset.set)][1];
      button.setAttribute("aria-pressed", String(set.system === system && set.h === step && set.schemes.join() === schemes.join()));
    }
    drawBoxes();
    alert.hidden = true;
    for (const old of runs)
      void engine()
        .drop(old.world)
        .catch(() => {});
    runs = schemes.map((scheme, k) => {
      const canvas = h("canvas", { "aria-hidden": "true" });
      const ratio = h("output", { class: "big", "data-ratio": scheme, "aria-live": "off" }, "1");
      const verdict = h("p", { class: "verdict" });
      const predicted = h("p", { class: "muted predicted" });
      const card = h(
        "article",
        { class: "run", "data-scheme": scheme, style: `--curve:${curveStyle(k)}` },
        h(
          "div",
          { class: "run-head" },
          h("h2", {}, plain(scheme)),
          h(
            "button",
            {
              type: "button",
              class: "as-scene",
              "aria-label": `Open ${plain(scheme)} as a scene`,
              title: "Open as a scene, with text and values",
              onclick: () => void openScene(scheme),
            },
            "↗",
          ),
        ),
        canvas,
        h("div", { class: "run-figure" }, h("span", { class: "muted" }, s.field ? "r / r₀" : "E / E₀"), ratio),
        predicted,
        verdict,
      );
      return {
        world: 10 + k,
        scheme,
        info: null,
        frame: null,
        n: 0,
        quantity: [],
        error: [],
        path: [],
        first: 0,
        dead: "",
        steps: 0,
        shortest: Infinity,
        canvas,
        ratio,
        verdict,
        predicted,
        card,
      };
    });
    board.replaceChildren(...runs.map((r) => r.card));
    energyTitle.textContent = s.field ? "Radius, r / r₀" : "Energy, E / E₀";
    (phaseBox.querySelector(".axes") as HTMLElement).textContent = `${s.axes[0]} →, ${s.axes[1]} ↑`;
    phaseTitle.textContent = s.phase.length === 2 ? "Phase" : "Path";
    errorBox.hidden = !s.exact;
    rescale();
    error.setCurves(curves());
    try {
      await Promise.all(
        runs.map(async (run) => {
          run.info = await engine().load(s.toml(run.scheme, step), { world: run.world });
          const frame = await engine().read({}, run.world);
          if (own !== age) return;
          run.first = frame.ledgers[0]?.energy ?? 0;
          take(run, frame);
        }),
      );
      if (own !== age) return;
      limits = s.field
        ? flowLimits(system)
        : ((
            await engine()
              .stability(runs[0].world)
              .catch(() => [])
          )[0]?.limits ?? []);
    } catch (e) {
      if (own !== age) return;
      if (!(e instanceof EngineError)) throw e;
      alert.hidden = false;
      alert.replaceChildren(h("strong", {}, "This failed."), h("pre", {}, e.failure.message));
      return;
    }
    if (own !== age) return;
    drawMarks();
    draw();
    void cards([s.theory, { page: "integrators", tags: [...new Set(schemes.map((x) => `integrators.${SCHEMES[x]}`))] }]).then(
      (made) => own === age && theory.replaceChildren(...made),
    );
    main.dataset.ready = "true";
    if (!still && !closed) start();
  };

  const rescale = () => {
    energy.close();
    energy.element.remove();
    energy = make("Energy relative to the initial energy against time", log);
    energyBox.append(energy.element);
    energy.setCurves(curves());
    draw();
  };

  const take = (run: Run, frame: Frame) => {
    const s = SYSTEMS[system];
    run.frame = frame;
    const first = frame.index - frame.ledgers.length + 1;
    frame.ledgers.forEach((ledger, i) => {
      if (!s.field) run.quantity[Math.max(first, 0) + i] = quantityOf(run, ledger, null);
    });
    if (s.field) run.quantity[frame.index] = quantityOf(run, undefined, frame);
    run.n = frame.index;
    run.steps += frame.report?.steps ?? 0;
    run.shortest = Math.min(run.shortest, frame.report?.step_range?.[0] ?? Infinity);
    const columns = frame.columns[s.object] ?? {};
    const x = columns.position?.data;
    if (x) {
      run.path.push(s.phase(x, columns.velocity?.data));
      if (run.path.length > 4000) run.path.splice(0, 1000);
      if (s.exact) {
        const e = s.exact(frame.time);
        const k = x.length - 3;
        const off = Math.hypot(x[k] - e[0], x[k + 1] - e[1], x[k + 2] - e[2]);
        run.error[frame.index] = off > 1e-13 ? off : null;
      }
    }
  };

  let drawn = 0;
  const draw = (now = true) => {
    if (!runs.length || !runs[0].quantity.length) return;
    const s = SYSTEMS[system];
    const most = Math.max(...runs.map((r) => r.n));
    clock.textContent = `${show(most * step, 3)} s`;
    main.dataset.steps = String(most);
    runs.forEach((run, k) => {
      const q0 = run.quantity[0] || 1;
      const q = run.quantity[run.n];
      const ratio = q === null || q === undefined ? NaN : q / q0;
      if (!run.dead) run.ratio.textContent = show(ratio, 4);
      run.ratio.dataset.value = String(ratio);
      run.ratio.dataset.steps = String(run.n);
      const predict = system === "spring" ? PREDICTED[run.scheme] : undefined;
      const z = W * step;
      run.predicted.textContent = predict ? `formula: ${show(predict(z, run.n), 4)}` : "";
      run.verdict.textContent =
        run.dead ||
        (ADAPTIVE.has(run.scheme) && run.steps ? `${run.steps} steps so far, the shortest ${show(run.shortest, 2)} s` : judge(run.scheme));
      run.verdict.classList.toggle("bad", !!run.dead || /too long|no step/.test(run.verdict.textContent));
      sketch(run, curveColor(k));
    });
    if (now || performance.now() - drawn > 120) {
      drawn = performance.now();
      const stride = Math.max(1, Math.ceil(most / 1500));
      const rows = Math.floor(most / stride) + 1;
      const xs = Array.from({ length: rows }, (_, i) => i * stride * step);
      const thin = (list: (number | null)[], scale: number) =>
        xs.map((_, i) => {
          for (let j = i * stride; j < (i + 1) * stride; j++) {
            const v = list[j];
            if (v !== null && v !== undefined && Number.isFinite(v) && (!log || scale === 0 || v / scale > 0)) return scale ? v / scale : v;
          }
          return undefined as unknown as null;
        });
      energy.set([xs, ...runs.map((r) => thin(r.quantity, r.quantity[0] || 1))]);
      if (s.exact) error.set([xs, ...runs.map((r) => thin(r.error, 0))]);
      drawPhase();
    }
  };

  const fit = (canvas: HTMLCanvasElement): [CanvasRenderingContext2D, number, number] => {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const w = canvas.clientWidth;
    const hgt = canvas.clientHeight;
    if (canvas.width !== Math.round(w * ratio)) canvas.width = Math.round(w * ratio);
    if (canvas.height !== Math.round(hgt * ratio)) canvas.height = Math.round(hgt * ratio);
    const context = canvas.getContext("2d")!;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, hgt);
    return [context, w, hgt];
  };

  /** Small picture of the masses. */
  const sketch = (run: Run, color: string) => {
    const s = SYSTEMS[system];
    const x = run.frame?.columns[s.object]?.position?.data;
    const [c, w, hgt] = fit(run.canvas);
    if (!x || !w) return;
    const up = system === "pendulum" || system === "sheet" ? 2 : 1;
    const frames: Record<string, [number, number, number]> = {
      spring: [-0.2, 0, 0.95],
      rusty: [0.8, 0, 0.95],
      pendulum: [0, -0.45, 1.35],
      orbit: [-0.5, 0, 1.35],
      swirl: [0, 0, 1.7],
      sink: [0, 0, 1.3],
      sheet: [0, -0.35, 0.95],
    };
    const [mx, my, half] = frames[system];
    const scale = Math.min(w, hgt * 1.6) / (2 * half) / (hgt < w ? Math.max(1, w / hgt / 1.6) : 1);
    const put = (i: number): [number, number] => {
      const side = system === "sheet" ? x[3 * i] + 0.45 * x[3 * i + 1] : x[3 * i];
      return [w / 2 + (side - mx) * scale, hgt / 2 - (x[3 * i + up] - my) * scale];
    };
    const ink = isDark() ? "#8b95a0" : "#7a848e";
    c.lineWidth = 1.25;
    if (s.field || system === "orbit") {
      c.strokeStyle = color;
      c.globalAlpha = 0.5;
      c.beginPath();
      for (const [i, p] of run.path.slice(-400).entries())
        c[i ? "lineTo" : "moveTo"](w / 2 + (p[0] - mx) * scale, hgt / 2 - (p[1] - my) * scale);
      c.stroke();
      c.globalAlpha = 1;
      c.fillStyle = ink;
      c.beginPath();
      c.arc(w / 2 + (0 - mx) * scale, hgt / 2 + my * scale, system === "orbit" ? 5 : 1.5, 0, 7);
      c.fill();
    }
    const links = run.info?.topology[s.object]?.links?.data;
    if (links) {
      c.strokeStyle = system === "sheet" ? color : ink;
      c.globalAlpha = system === "sheet" ? 0.55 : 1;
      c.beginPath();
      if (system === "spring" || system === "rusty") {
        const [a, b] = [put(0), put(1)];
        // The wall is where there is room for it.
        if (system === "spring") a[0] = w / 2 + (-1 - mx) * scale;
        c.moveTo(...a);
        for (let i = 1; i < 16; i++) c.lineTo(a[0] + ((b[0] - a[0]) * i) / 16, a[1] + (i % 2 ? 6 : -6));
        c.lineTo(...b);
      } else
        for (let i = 0; i < links.length; i += 2) {
          c.moveTo(...put(links[i]));
          c.lineTo(...put(links[i + 1]));
        }
      c.stroke();
      c.globalAlpha = 1;
    }
    if (system !== "sheet") {
      const n = x.length / 3;
      for (let i = 0; i < n; i++) {
        const [a, b] = put(i);
        if (system === "spring" && i === 0) continue;
        c.fillStyle = n > 1 && i === 0 ? ink : color;
        c.beginPath();
        c.arc(a, b, n > 1 && i === 0 ? 4 : 7, 0, 7);
        c.fill();
      }
    }
  };

  const drawPhase = () => {
    const s = SYSTEMS[system];
    const [c, w, hgt] = fit(phase);
    if (!w) return;
    const exact: [number, number][] = [];
    if (s.exact && s.field) for (let i = 0; i <= 240; i++) exact.push(s.exact((i / 240) * 6.3).slice(0, 2) as [number, number]);
    else if (s.exact && system === "orbit")
      for (let i = 0; i <= 240; i++) exact.push(s.exact((i / 240) * 6.2832).slice(0, 2) as [number, number]);
    else if (system === "spring") for (let i = 0; i <= 120; i++) exact.push([0.5 * Math.cos(i / 19), -0.5 * Math.sin(i / 19)]);
    // As large as what is of interest; a blow-up leaves the picture.
    const size = (list: [number, number][]) => list.reduce((m, [a, b]) => Math.max(m, Math.abs(a), Math.abs(b)), 0);
    const calm = size(exact) || size(runs[runs.length - 1].path) || 1;
    const half = Math.min(Math.max(size(exact), ...runs.map((r) => size(r.path))), 3 * calm) * 1.1 || 1;
    const scale = Math.min(w, hgt) / 2 / half;
    const line = (list: [number, number][], color: string, width: number, dash: number[] = []) => {
      c.strokeStyle = color;
      c.lineWidth = width;
      c.setLineDash(dash);
      c.beginPath();
      list.forEach(
        ([a, b], i) =>
          Number.isFinite(a + b) &&
          c[i ? "lineTo" : "moveTo"](w / 2 + Math.max(-9e3, Math.min(9e3, a * scale)), hgt / 2 - Math.max(-9e3, Math.min(9e3, b * scale))),
      );
      c.stroke();
      c.setLineDash([]);
    };
    const grid = getComputedStyle(document.documentElement).getPropertyValue("--line");
    line(
      [
        [-half * 9, 0],
        [half * 9, 0],
      ],
      grid,
      1,
    );
    line(
      [
        [0, -half * 9],
        [0, half * 9],
      ],
      grid,
      1,
    );
    runs.forEach((r, k) => line(r.path.slice(-1200), curveColor(k), 1.5));
    line(exact, isDark() ? "#ffffff" : "#000000", 1, [2, 4]);
    runs.forEach((r, k) => {
      const p = r.path[r.path.length - 1];
      if (!p) return;
      c.fillStyle = curveColor(k);
      c.beginPath();
      c.arc(w / 2 + p[0] * scale, hgt / 2 - p[1] * scale, 4, 0, 7);
      c.fill();
    });
  };

  let ticking = 0;
  let clockAt = 0;
  let due = 0;
  let busy = false;
  const start = () => {
    if (playing || !runs.length) return;
    if (runs.every((r) => r.dead || r.n * step >= SYSTEMS[system].end)) return void restart();
    playing = true;
    setIcon(play, "pause", "Pause");
    clockAt = performance.now();
    due = 1;
    ticking = requestAnimationFrame(tick);
  };
  const pause = () => {
    playing = false;
    cancelAnimationFrame(ticking);
    setIcon(play, "play", "Play");
  };
  const tick = (now: number) => {
    if (!playing) return;
    ticking = requestAnimationFrame(tick);
    due = Math.min(due + (((now - clockAt) / 1000) * speed) / step, Math.max(4, 0.2 / step));
    clockAt = now;
    if (busy || due < 1) return;
    const n = Math.floor(due);
    due -= n;
    void forward(n);
  };
  /** All runs go on together, by as many steps. */
  const forward = async (n: number) => {
    busy = true;
    const own = age;
    const s = SYSTEMS[system];
    const left = Math.ceil(s.end / step) - Math.max(...runs.map((r) => (r.dead ? 0 : r.n)));
    const frames = Math.min(n, left);
    if (frames <= 0 || runs.every((r) => r.dead)) {
      busy = false;
      pause();
      draw();
      return;
    }
    // Paths want every step where steps are long.
    const each = s.field || step > 0.02 ? 1 : frames;
    for (let done = 0; done < frames && own === age; done += each) {
      await Promise.all(
        runs.map(async (run) => {
          if (run.dead) return;
          try {
            const frame = await engine().step({ frames: Math.min(each, frames - done) }, run.world);
            if (own === age) take(run, frame);
          } catch (e) {
            if (own !== age) return;
            if (!(e instanceof EngineError)) throw e;
            run.dead = `blew up in step ${run.n + 1}, at ${show((run.n + 1) * step, 3)} s: the engine stops at a thousandfold energy`;
            run.card.dataset.dead = "true";
            if (e.failure.kind !== "step") run.dead = e.failure.message.split("\n")[0];
          }
        }),
      );
    }
    busy = false;
    if (own === age) draw(false);
  };

  const theme = () => draw();
  addEventListener("themechange", theme);
  const keydown = (event: KeyboardEvent) => {
    if (event.key !== " " || (event.target as HTMLElement).closest("input, select, button, a, pre")) return;
    event.preventDefault();
    if (playing) pause();
    else start();
  };
  addEventListener("keydown", keydown);
  const sized = new ResizeObserver(() => draw());
  sized.observe(board);
  engine().onrestart = () => void restart();
  void restart();

  return () => {
    closed = true;
    age++;
    pause();
    clearTimeout(timer);
    removeEventListener("themechange", theme);
    removeEventListener("keydown", keydown);
    sized.disconnect();
    energy.close();
    error.close();
    for (const run of runs)
      void engine()
        .drop(run.world)
        .catch(() => {});
  };
};
