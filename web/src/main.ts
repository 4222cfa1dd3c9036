import "./style.css";
import { h, iconButton, type Leave, type Page, say } from "./dom";

/** Each visit has its own, so that a page that is left before it has come appears nowhere. */
let main = document.getElementById("main")!;
const nav = document.getElementById("nav")!;

/** Address after "#/" -> page, with its name in the header; each is fetched when it is first opened. */
const PAGES: { address: RegExp; link?: [string, string]; open: () => Promise<{ page: Page }> }[] = [
  { address: /^$/, link: ["", "Gallery"], open: () => import("./pages/gallery") },
  { address: /^fluid(?:\/(.*))?$/, link: ["fluid", "Fluid"], open: () => import("./pages/fluid") },
  { address: /^integrators(?:\/(.*))?$/, link: ["integrators", "Integrators"], open: () => import("./pages/integrators") },
  { address: /^structures(?:\/(.*))?$/, link: ["structures", "Structures"], open: () => import("./pages/structures") },
  { address: /^theory(?:\/(.*))?$/, link: ["theory", "Theory"], open: () => import("./pages/theory") },
  { address: /^scene\/(.*)$/, open: () => import("./pages/scene") },
  { address: /^(s\/.*)$/, open: () => import("./pages/scene") },
];

for (const { link } of PAGES) if (link) nav.append(h("a", { href: `#/${link[0]}` }, link[1]));

// Light or dark: as the system says, until a person says otherwise.
const system = matchMedia("(prefers-color-scheme: dark)");
function theme(wish: string | null): void {
  document.documentElement.dataset.theme = wish ?? (system.matches ? "dark" : "light");
  dispatchEvent(new Event("themechange"));
}
/** The user's choice; nothing if the browser stores nothing. */
function wished(): string | null {
  try {
    return localStorage.getItem("theme");
  } catch {
    return null;
  }
}
system.addEventListener("change", () => theme(wished()));
theme(wished());
document.getElementById("tools")!.append(
  iconButton("theme", "Toggle light and dark", () => {
    const next = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    try {
      localStorage.setItem("theme", next);
    } catch {
      // Holds for this visit.
    }
    theme(next);
  }),
);

let leave: Leave = () => {};
let visit = 0;

/** The engine of a page, where its precision is known from the address. */
async function warm(address: string): Promise<void> {
  const [page, ...rest] = address.split("/");
  if (!["scene", "fluid", "integrators", "structures"].includes(page)) return;
  const [{ engine }, { sceneOf }] = await Promise.all([import("./session"), import("./scenes")]);
  const precision = page === "scene" ? sceneOf(rest.join("/"))?.precision : page === "integrators" ? "double" : "single";
  if (precision) await engine().warm(precision);
}

async function go(): Promise<void> {
  const own = ++visit;
  let address = location.hash.replace(/^#\/?/, "");
  try {
    address = decodeURI(address);
  } catch {
    // A damaged address: as it stands.
  }
  leave();
  leave = () => {};
  const fresh = h("main", { id: "main", tabindex: -1 });
  main.replaceWith(fresh);
  main = fresh;
  // The engine comes while the page does.
  void warm(address).catch(() => {});
  const section = address.split("/")[0];
  for (const link of nav.querySelectorAll("a")) {
    if (link.getAttribute("href") === `#/${section === "scene" ? "" : section}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  for (const { address: pattern, open } of PAGES) {
    const match = pattern.exec(address);
    if (!match) continue;
    let end: Leave;
    try {
      const { page } = await open().catch((error) => {
        console.error(error);
        throw new Error("A part of the laboratory could not be fetched. Once the connection is back, reload the page.");
      });
      if (own !== visit) return;
      scrollTo(0, 0);
      end = await page(fresh, match[1] ?? "");
    } catch (error) {
      if (own !== visit) return;
      const webgl = document.createElement("canvas").getContext("webgl2");
      main.className = "";
      main.replaceChildren(
        h(
          "div",
          { class: "narrow" },
          h("h1", {}, "This page could not be shown"),
          h("p", {}, webgl ? String((error as Error)?.message ?? error) : "It requires WebGL 2, which this browser does not support."),
        ),
      );
      console.error(error);
      return;
    }
    if (own !== visit) end();
    else leave = end;
    return;
  }
  document.title = "tumble";
  main.append(h("div", { class: "narrow" }, h("h1", {}, "Page not found"), h("p", {}, h("a", { href: "#/" }, "To the gallery"))));
}

// The address is that of the page: it must not become "#main".
document.querySelector(".skip")!.addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});

// Scenes and meshes may be dropped on any page.
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  const files = [...(event.dataTransfer?.files ?? [])];
  if (files.length)
    void import("./files").then(({ acceptFiles }) => acceptFiles(files)).catch((error) => say(String(error.message ?? error)));
});

addEventListener("hashchange", () => void go());
void go();
