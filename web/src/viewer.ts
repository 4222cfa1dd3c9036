/** Shared by all pages of one world: its picture, failures, and cleanup. */
import { h } from "./dom";
import { EngineError } from "./engine/client";
import type { Failure, FailureKind } from "./engine/protocol";
import { legendBox } from "./legend";
import { engine, Session } from "./session";
import { keys } from "./transport";
import { Stage } from "./view/stage";

const HEADS: Record<FailureKind, string> = {
  scene: "The scene has an error; the previous one is still here.",
  step: "The simulation failed.",
  limit: "Too large for this tab.",
  crash: "The engine was restarted.",
};

export const reducedMotion = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

export class Viewer {
  readonly session = new Session();
  readonly canvas = h("canvas", { "aria-hidden": "true" });
  readonly stage: Stage;
  /** The picture, with its legend. */
  readonly box: HTMLElement;
  readonly alert = h("div", { class: "alert", role: "alert", hidden: true });
  readonly tellLegend: () => void;
  private readonly wait = h("div", { class: "wait" }, "Loading the engine …");
  private readonly gone = h(
    "div",
    { class: "wait gone", role: "alert", hidden: true },
    h("p", {}, "The browser has taken the graphics away from this page. The picture comes back when the browser gives them back."),
    h("button", { type: "button", class: "button", onclick: () => location.reload() }, "Reload the page"),
  );
  private far: HTMLElement | null = null;
  private readonly offKeys: () => void;
  private readonly theme = () => this.stage.theme();

  constructor(
    private readonly main: HTMLElement,
    /** Read to those who do not see the picture. */
    label: string,
    /** Whether pointers and keys turn the camera. */
    turns = true,
    /** Actions for a failure. */
    private readonly remedy: (failure: Failure) => Node | null = () => null,
  ) {
    main.className = "lab-page";
    const legend = legendBox(() => this.stage);
    this.tellLegend = legend.update;
    this.box = h(
      "div",
      { class: "stage", tabindex: 0, role: "group", "aria-label": label },
      this.canvas,
      legend.element,
      this.wait,
      this.gone,
    );
    const { session } = this;
    const stage = (this.stage = new Stage(this.canvas, turns));
    stage.onlost = (lost) => (this.gone.hidden = !lost);
    session.wanted = () => stage.wanted;
    session.on("loaded", () => (this.wait.hidden = true));
    session.on("frame", (frame) => (main.dataset.frame = String(frame.index)));
    session.on("failed", (failure) => this.complain(failure));
    addEventListener("themechange", this.theme);
    this.offKeys = keys(session, turns ? stage : undefined);
    engine().onrestart = this.restarted;
    // For tests and for the curious.
    Object.assign(window, { tumble: { session, stage, engine: engine() } });
  }

  private readonly restarted = (message: string): void => {
    this.complain({ kind: "crash", message: `${message}\nThe scene is back at its start.`, issues: [] });
    void this.session.revived();
  };

  complain(failure: Failure): void {
    const { alert } = this;
    alert.hidden = false;
    alert.dataset.kind = failure.kind;
    alert.replaceChildren(
      h("strong", {}, failure.kind === "scene" && !this.session.info ? "The scene has an error." : HEADS[failure.kind]),
      h("pre", {}, failure.message.split("\n").slice(0, 12).join("\n")),
    );
    const remedy = this.remedy(failure);
    if (remedy) alert.append(remedy);
  }

  /** Does what may be refused; answers with what went wrong, if anything did. */
  async attempt(act: () => Promise<unknown>): Promise<Failure | null> {
    try {
      await act();
      this.alert.hidden = true;
      return null;
    } catch (error) {
      if (!(error instanceof EngineError)) throw error;
      this.complain(error.failure);
      return error.failure;
    }
  }

  /** Says how far something long is, with a way out of it. */
  waiting(text: string, stop: () => void): void {
    this.wait.hidden = false;
    this.far ??= h("span", {});
    this.far.textContent = text;
    // One button for all of the way: it must not go away under the finger.
    if (!this.far.isConnected)
      this.wait.replaceChildren(this.far, h("button", { type: "button", class: "button", onclick: stop }, "Stop here"));
  }

  /** The same with the first scene: after it the page is ready. */
  async begin(act: () => Promise<unknown>): Promise<Failure | null> {
    const failure = await this.attempt(act);
    this.wait.hidden = true;
    this.main.dataset.ready = failure ? "failed" : "true";
    return failure;
  }

  close(): void {
    removeEventListener("themechange", this.theme);
    this.offKeys();
    if (engine().onrestart === this.restarted) engine().onrestart = () => {};
    this.session.close();
    this.stage.dispose();
  }
}
