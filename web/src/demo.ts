/** Settings and figures of the demos. */
import { h } from "./dom";
import { addressed } from "./source";

/** A slider that tells its value as `text`, and acts when it comes to rest. */
export function slide(
  label: string,
  low: number,
  high: number,
  value: number,
  text: (v: number) => string,
  act: (v: number) => void,
  step = (high - low) / 100,
): HTMLLabelElement {
  const out = h("output", {}, text(value));
  let timer = 0;
  const input = h("input", {
    type: "range",
    min: low,
    max: high,
    step,
    value,
    "aria-label": label,
    "aria-valuetext": text(value),
    oninput: () => {
      out.textContent = text(Number(input.value));
      input.setAttribute("aria-valuetext", text(Number(input.value)));
      clearTimeout(timer);
      timer = window.setTimeout(() => act(Number(input.value)), 120);
    },
  });
  return h("label", { class: "slide" }, h("span", { class: "slide-head" }, h("span", {}, label), out), input);
}

/** A number that changes with each frame: not read aloud by itself. */
export function figure(label: string, id: string | null = null): { value: HTMLElement; row: HTMLElement } {
  const value = h("output", { id, "aria-label": label, "aria-live": "off" }, "–");
  return { value, row: h("div", { class: "figure" }, h("span", {}, label), value) };
}

/** Opens a scene of a demo on the page of scenes, with an end. */
export async function asScene(toml: string, frames: number): Promise<void> {
  location.hash = await addressed(toml.replace(/^frames = .*$/m, `frames = ${frames}`));
}

export const asSceneButton = (act: () => Promise<void>): HTMLButtonElement =>
  h("button", { type: "button", class: "button", title: "With its text and all values", onclick: () => void act() }, "Open as a scene");
