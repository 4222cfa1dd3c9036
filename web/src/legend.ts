/** Legend of the colours of a picture. */
import { h, show } from "./dom";
import { gradient, mapOf } from "./view/colors";
import type { Stage } from "./view/stage";

export function legendBox(stage: () => Stage): { element: HTMLElement; update: () => void } {
  const element = h("div", { class: "legend", hidden: true });
  const update = () => {
    const l = stage().legend;
    element.hidden = !l;
    if (!l) return;
    element.replaceChildren(
      h("span", { class: "legend-name" }, l.unit && l.unit !== "1" ? `${l.name}, ${l.unit}` : l.name),
      h("i", { style: `background:${gradient(mapOf(l.name))}` }),
      h(
        "span",
        { class: "legend-ends" },
        h("span", {}, show(l.low, 3)),
        l.low === -l.high ? h("span", {}, "0") : null,
        h("span", {}, show(l.high, 3)),
      ),
    );
  };
  return { element, update };
}
