/** All scenes that ship, with pictures. */
import { h, type Page, say } from "../dom";
import { acceptFiles } from "../files";
import { rowTitle, SCENES, type Shipped } from "../scenes";

export const page: Page = async (main) => {
  document.title = "tumble · a physics engine in a browser tab";
  // Only those who search wait for the texts.
  let texts: string[] = [];
  let asked = false;
  const fetchTexts = async () => {
    if (asked) return;
    asked = true;
    texts = await Promise.all(SCENES.map((s) => s.text().catch(() => "")));
    draw();
  };
  const card = (s: Shipped) =>
    h(
      "li",
      {},
      h(
        "a",
        { class: "tile", href: `#/scene/${s.id}` },
        s.picture
          ? h("img", { src: s.picture, alt: "", width: 480, height: 270, loading: "lazy", decoding: "async" })
          : h("span", { class: "no-picture" }),
        h("span", { class: "tile-title" }, s.title || s.name),
        h("span", { class: "tile-id" }, s.id),
      ),
    );
  const rows = [...new Set(SCENES.map((s) => s.row))];
  const list = h("div", { class: "rows" });
  const filter = h("input", {
    type: "search",
    placeholder: "cloth, smoke, orbit …",
    "aria-label": "Find a scene",
    oninput: () => (draw(), void fetchTexts()),
  });
  const draw = () => {
    const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const hit = (s: Shipped, i: number) =>
      words.every((w) => `${s.id} ${s.title} ${texts[i] ?? ""} ${rowTitle(s.row)}`.toLowerCase().includes(w));
    const sections = rows.map((row) => {
      const own = SCENES.map((s, i) => ({ s, i })).filter(({ s, i }) => s.row === row && hit(s, i));
      return own.length ? h("section", {}, h("h2", {}, rowTitle(row)), h("ul", { class: "tiles" }, ...own.map(({ s }) => card(s)))) : null;
    });
    list.replaceChildren(...sections.filter((s) => s !== null));
    if (!list.childElementCount) list.append(h("p", { class: "muted" }, "No scene matches."));
  };
  const file = h("input", {
    type: "file",
    accept: ".toml,.json,.tumble,.ply,.obj,.stl,.glb",
    multiple: true,
    class: "visually-hidden",
    id: "file",
    onchange: () => void acceptFiles([...(file.files ?? [])]).catch((e) => say(String(e.message ?? e))),
  });
  main.append(
    h(
      "div",
      { class: "gallery" },
      h(
        "div",
        { class: "hero" },
        h("h1", {}, "Physics you can take apart"),
        h(
          "p",
          { class: "lead" },
          "Cloth, particles, orbits, smoke and the numerical methods behind them. The whole engine runs in this tab: nothing is uploaded, and results are bit-identical to those of the command line.",
        ),
        h(
          "div",
          { class: "hero-actions" },
          h("a", { class: "button primary", href: "#/fluid" }, "Stir a fluid"),
          h("a", { class: "button", href: "#/integrators" }, "Compare integrators"),
          h("a", { class: "button", href: "#/structures" }, "Take a structure apart"),
          h("a", { class: "button", href: "#/scene/particles/fountain" }, "Play with particles"),
          file,
          h("label", { for: "file", class: "button" }, "Open a file …"),
        ),
      ),
      h("div", { class: "filter" }, filter),
      list,
    ),
  );
  draw();
  return () => {};
};
