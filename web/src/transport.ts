/** Play, pause, one frame, back, speed, and the way through kept frames. */
import { choice, h, iconButton, setIcon, show } from "./dom";
import type { Session } from "./session";

export function transport(session: Session): HTMLElement {
  const play = iconButton("play", "Play", () => session.toggle(), { class: "icon-button primary" });
  const slider = h("input", {
    type: "range",
    min: 0,
    max: 1,
    step: 1,
    value: 0,
    "aria-label": "Frame",
    class: "scrub",
    oninput: () => session.scrub(Number(slider.value)),
  });
  const clock = h("output", { class: "clock", "aria-label": "Frame and time", "aria-live": "off" });
  const cost = h("span", { class: "cost" });
  const pace = h("p", { class: "pace" });
  /** Of a scene that is not played in its own time: how many frames, and how much of its time, a second shows. */
  const tellPace = () => {
    const { info, rate } = session;
    if (!info) return;
    const times = rate / info.fps;
    const own = Math.abs(times / session.speed - 1) < 1e-9;
    pace.hidden = own;
    pace.textContent = own
      ? ""
      : `Plays ${show(rate, 3)} frames a second; the scene has ${show(info.fps, 3)}: one second shows ${show(times, 3)} s of its time.`;
  };
  const update = () => {
    const frame = session.shown;
    const info = session.info;
    if (!frame || !info) return;
    const last = session.endless ? session.latest : Math.max(info.frames, session.latest);
    slider.max = String(last);
    slider.value = String(frame.index);
    slider.style.setProperty("--there", `${(100 * session.latest) / Math.max(last, 1)}%`);
    slider.style.setProperty("--here", `${(100 * frame.index) / Math.max(last, 1)}%`);
    const { inside } = frame;
    const between = inside ? ` + ${inside.substeps} sub-step${inside.substeps > 1 ? "s" : ""}` : "";
    slider.setAttribute("aria-valuetext", `frame ${frame.index}${between} of ${last}, ${show(frame.time)} seconds`);
    clock.textContent = inside
      ? `${frame.index}${between} (${inside.system}, ${show(inside.step, 3)} s) · ${show(frame.time, 4)} s`
      : `${frame.index} / ${last} · ${show(frame.time, 3)} s`;
    cost.textContent = session.cost ? `${show(session.cost, 2)} ms a frame` : "";
  };
  session.on("frame", update);
  session.on("loaded", update);
  session.on("loaded", tellPace);
  session.on("playing", (on) => setIcon(play, on ? "pause" : "play", on ? "Pause" : "Play"));
  return h(
    "div",
    { class: "transport", role: "group", "aria-label": "Playback" },
    play,
    iconButton("back", "One frame back", () => session.previous()),
    iconButton("substep", "One sub-step forward", () => void session.substep()),
    iconButton("next", "One frame forward", () => void session.next()),
    iconButton("reset", "Back to the start", () => void session.reset()),
    slider,
    clock,
    choice(
      "Speed",
      [
        ["0.1", "0.1 ×"],
        ["0.25", "0.25 ×"],
        ["0.5", "0.5 ×"],
        ["1", "1 ×"],
        ["2", "2 ×"],
        ["4", "4 ×"],
      ],
      "1",
      (v) => {
        session.speed = Number(v);
        tellPace();
      },
    ),
    cost,
    pace,
  );
}

/** Keys of pages that play: space, comma and point, semicolon, arrows, Home. */
export function keys(session: Session, stage?: { nudge(dx: number, dy: number, zoom: number): void; goHome(): void }): () => void {
  const act = (event: KeyboardEvent) => {
    const target = event.target as HTMLElement;
    if (
      event.ctrlKey ||
      event.metaKey ||
      event.altKey ||
      target.closest("input:not([type=checkbox]), select, textarea, [contenteditable], [role=tab], button, a, summary")
    )
      return;
    const steps: Record<string, () => void> = {
      " ": () => session.toggle(),
      ".": () => void session.next(),
      ",": () => session.previous(),
      ";": () => void session.substep(),
      Home: () => void session.reset(),
    };
    if (stage && target.closest(".stage")) {
      Object.assign(steps, {
        ArrowLeft: () => stage.nudge(-1, 0, 1),
        ArrowRight: () => stage.nudge(1, 0, 1),
        ArrowUp: () => stage.nudge(0, -1, 1),
        ArrowDown: () => stage.nudge(0, 1, 1),
        "+": () => stage.nudge(0, 0, 1.15),
        "-": () => stage.nudge(0, 0, 1 / 1.15),
        "0": () => stage.goHome(),
      });
    }
    const step = steps[event.key];
    // A box is checked by the space bar.
    if (!step || (event.key === " " && target.closest("input"))) return;
    event.preventDefault();
    step();
  };
  addEventListener("keydown", act);
  return () => removeEventListener("keydown", act);
}
