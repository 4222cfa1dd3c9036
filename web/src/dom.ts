/** Elements without a framework. Text is always set as text: titles and messages of scenes are never read as HTML. */

type Child = Node | string | null | undefined | false;
type Listener = (event: any) => void;
export type Props = Record<string, string | number | boolean | null | undefined | Listener>;

function apply(element: Element, props: Props): void {
  for (const [key, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(key.replace(/^on/, ""), value);
    else if (value === true) element.setAttribute(key, "");
    else element.setAttribute(key, String(value));
  }
}

export function h<K extends keyof HTMLElementTagNameMap>(tag: K, props: Props = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  apply(element, props);
  for (const child of children) if (child) element.append(child);
  return element;
}

export function svg(path: string, size = 20): SVGSVGElement {
  const space = "http://www.w3.org/2000/svg";
  const element = document.createElementNS(space, "svg");
  apply(element, { viewBox: "0 0 20 20", width: size, height: size, "aria-hidden": "true", focusable: "false", class: "icon" });
  const shape = document.createElementNS(space, "path");
  shape.setAttribute("d", path);
  element.append(shape);
  return element;
}

/** Twenty by twenty, filled. */
export const ICONS = {
  play: "M5 3.5v13l11-6.5z",
  pause: "M5 3.5h3.6v13H5zm6.4 0H15v13h-3.6z",
  next: "M4 3.5v13l8.5-6.5zM13.5 3.5H16v13h-2.5z",
  back: "M16 3.5v13L7.5 10zM4 3.5h2.5v13H4z",
  reset: "M10 4V1L5.5 5 10 9V6a4.5 4.5 0 1 1-4.5 4.5h-2A6.5 6.5 0 1 0 10 4z",
  substep: "M4 5h2v10H4zm5 2.5 5 2.5-5 2.5zM15.5 8.6a1.4 1.4 0 1 1 0 2.8 1.4 1.4 0 0 1 0-2.8z",
  share:
    "M14 2.5a2.5 2.5 0 0 0-2.4 3.1L7.7 8a2.5 2.5 0 1 0 0 4l3.9 2.4A2.5 2.5 0 1 0 12.6 13L8.9 10.6a2.6 2.6 0 0 0 0-1.2L12.6 7A2.5 2.5 0 1 0 14 2.5z",
  camera:
    "M7 3.5 5.8 5.5H3A1.5 1.5 0 0 0 1.5 7v8A1.5 1.5 0 0 0 3 16.5h14a1.5 1.5 0 0 0 1.5-1.5V7A1.5 1.5 0 0 0 17 5.5h-2.8L13 3.5zM10 7.5a3.5 3.5 0 1 1 0 7 3.5 3.5 0 0 1 0-7z",
  record: "M10 4a6 6 0 1 1 0 12 6 6 0 0 1 0-12z",
  stop: "M5 5h10v10H5z",
  down: "M9 2.5h2v7.7l2.8-2.8 1.4 1.4L10 14 4.8 8.8l1.4-1.4L9 10.2zM3.5 15.5h13v2h-13z",
  cube: "M10 1.5 17.5 5.5v9L10 18.5 2.5 14.5v-9zm0 2.2L6 5.9l4 2.1 4-2.1zM4.3 7.2v6.2l4.8 2.6V9.7zm11.4 0-4.8 2.5V16l4.8-2.6z",
  theme: "M10 2a8 8 0 1 0 0 16zM10 2a8 8 0 0 1 0 16V2zm0 2v12a6 6 0 0 0 0-12z",
  frame: "M3 3h5v2H5v3H3zm9 0h5v5h-2V5h-3zM3 12h2v3h3v2H3zm12 0h2v5h-5v-2h3z",
};

/** A button with an icon alone; its label is read and shown as a hint. */
export function iconButton(icon: keyof typeof ICONS, label: string, act: () => void, props: Props = {}): HTMLButtonElement {
  return h("button", { type: "button", class: "icon-button", "aria-label": label, title: label, onclick: act, ...props }, svg(ICONS[icon]));
}

export function setIcon(button: HTMLButtonElement, icon: keyof typeof ICONS, label: string): void {
  button.replaceChildren(svg(ICONS[icon]));
  button.setAttribute("aria-label", label);
  button.title = label;
}

/** A select with a visible label. */
export function choice(label: string, options: [string, string][], value: string, act: (value: string) => void): HTMLLabelElement {
  const list = h(
    "select",
    { onchange: () => act(list.value) },
    ...options.map(([v, text]) => h("option", { value: v, selected: v === value }, text)),
  );
  return h("label", { class: "choice" }, h("span", {}, label), list);
}

export function check(label: string, on: boolean, act: (on: boolean) => void): HTMLLabelElement {
  const box = h("input", { type: "checkbox", checked: on, onchange: () => act(box.checked) });
  return h("label", { class: "check" }, box, h("span", {}, label));
}

/** A number for people: four digits, with powers of ten where they help. */
export function show(value: number | null | undefined, digits = 4): string {
  if (value === null || value === undefined) return "–";
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "not a number" : value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(Math.max(digits - 2, 0)) : String(Number(value.toPrecision(digits)));
  return text.replace("-", "−").replace(/e\+?(−?)(-?)(\d+)/, (_, a, b, d) => ` × 10${power(`${a || (b ? "−" : "")}${d}`)}`);
}

const RAISED: Record<string, string> = {
  "−": "⁻",
  "-": "⁻",
  "0": "⁰",
  "1": "¹",
  "2": "²",
  "3": "³",
  "4": "⁴",
  "5": "⁵",
  "6": "⁶",
  "7": "⁷",
  "8": "⁸",
  "9": "⁹",
};
const power = (text: string): string => [...text].map((c) => RAISED[c] ?? c).join("");

/** A message at the foot of the window, read aloud. */
export function say(text: string): void {
  let bar = document.getElementById("say");
  if (!bar) document.body.append((bar = h("div", { id: "say", role: "status", "aria-live": "polite" })));
  bar.textContent = text;
  bar.classList.add("shown");
  clearTimeout(Number(bar.dataset.timer));
  bar.dataset.timer = String(setTimeout(() => bar.classList.remove("shown"), Math.max(3500, 70 * text.length)));
}

export function saveAs(blob: Blob, name: string): void {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Cleanup when a page is left. */
export type Leave = () => void;
export type Page = (main: HTMLElement, rest: string) => Leave | Promise<Leave>;
