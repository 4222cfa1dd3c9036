/** The pages of docs/theory, as they are. */

import sources from "virtual:sources";
import { marked } from "marked";
import { h, type Page } from "../dom";
import { theoryNames, theoryText } from "../scenes";
import { heading, question } from "../theory";

export const page: Page = async (main, rest) => {
  const name = rest.split("#")[0];
  if (!name) {
    document.title = "Theory · tumble";
    const texts = await Promise.all(theoryNames.filter((n) => n !== "README").map(async (n) => ({ n, text: (await theoryText(n)) ?? "" })));
    texts.sort((a, b) => heading(a.text).localeCompare(heading(b.text)));
    main.append(
      h(
        "div",
        { class: "narrow" },
        h("h1", {}, "Theory"),
        h("p", { class: "lead" }, "One page for each method. Every equation has a number, which the engine's source cites."),
        h(
          "ul",
          { class: "contents" },
          ...texts.map(({ n, text }) =>
            h("li", {}, h("a", { href: `#/theory/${n}` }, heading(text)), h("span", { class: "muted" }, question(text))),
          ),
        ),
      ),
    );
    return () => {};
  }
  const text = theoryNames.includes(name) ? await theoryText(name) : null;
  if (!text) {
    main.append(
      h("div", { class: "narrow" }, h("h1", {}, "Page not found"), h("p", {}, h("a", { href: "#/theory" }, "All pages of theory"))),
    );
    return () => {};
  }
  document.title = `${heading(text)} · tumble`;
  const article = h("article", { class: "narrow prose" });
  // Our own pages, bundled; nothing that a scene holds comes here.
  article.innerHTML = await marked.parse(text.replace(/ {3,}(\([a-z]+\.\d+\))$/gm, "   $1"));
  for (const link of article.querySelectorAll("a")) {
    const to = link.getAttribute("href") ?? "";
    const other = /^([a-z]+)\.md(#.*)?$/.exec(to);
    if (other) link.setAttribute("href", `#/theory/${other[1]}`);
    else if (!/^https?:/.test(to)) link.replaceWith(...link.childNodes);
    else link.setAttribute("rel", "noreferrer");
  }
  for (const block of article.querySelectorAll("pre")) block.tabIndex = 0;
  const cited = Object.entries(sources).filter(([tag]) => tag.startsWith(`${name}.`));
  if (cited.length) {
    cited.sort((a, b) => Number(a[0].split(".")[1]) - Number(b[0].split(".")[1]));
    article.append(
      h("h2", {}, "In the engine"),
      h(
        "div",
        { class: "scroll", tabindex: 0 },
        h(
          "table",
          {},
          h(
            "tbody",
            {},
            ...cited.map(([tag, files]) =>
              h(
                "tr",
                {},
                h("th", { scope: "row" }, `(${tag})`),
                h("td", {}, ...files.flatMap((f, i) => [i ? h("br") : "", h("code", {}, f)])),
              ),
            ),
          ),
        ),
      ),
    );
  }
  for (const table of article.querySelectorAll(":scope > table")) {
    const box = h("div", { class: "scroll", tabindex: 0 });
    table.replaceWith(box);
    box.append(table);
  }
  main.append(h("p", { class: "narrow crumbs" }, h("a", { href: "#/theory" }, "Theory")), article);
  return () => {};
};
