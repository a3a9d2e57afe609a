import { button, element } from "./elements.js";
import { icon } from "./icons.js";

// A drawing that Python made, as elements: without style attributes, which the policy of the page refuses.
function drawn(text) {
  const svg = new DOMParser().parseFromString(text.replace(/ style="[^"]*"/g, ""), "image/svg+xml").documentElement;
  if (svg.nodeName !== "svg") return element("span", { class: "empty" });
  for (const one of svg.querySelectorAll("script, foreignObject, a")) one.remove();
  const [width, height] = [svg.getAttribute("width"), svg.getAttribute("height")];
  if (!svg.hasAttribute("viewBox") && width && height) svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  for (const name of ["width", "height"]) svg.removeAttribute(name);
  svg.setAttribute("aria-hidden", "true");
  return document.importNode(svg, true);
}

// How to begin: on an empty sheet a panel on it, and at any time a dialog.
export class Start {
  constructor(bench) {
    this.bench = bench;
    this.panel = element("div", { class: "start", hidden: true });
    bench.parts.stage.append(this.panel);
    bench.on("state", () => this.offer());
  }

  // The panel is there while nothing is drawn, until a tool is chosen.
  offer() {
    const empty = !this.bench.isDrawn && !(this.bench.state.picture?.points ?? []).length && !this.bench.photograph.image;
    if (!empty) { this.hide(); return; }
    if (this.left === this.bench.state.text) return;
    this.panel.replaceChildren(element("h1", {}, "Draw a mechanism"), ...this.ways(), element("h2", {}, "or begin with one of these"), this.cards(() => this.hide()));
    this.panel.hidden = false;
  }

  hide() {
    if (this.panel.hidden) return;
    this.left = this.bench.state.text;
    this.panel.hidden = true;
  }

  ways() {
    const { tools, photograph } = this.bench;
    const way = (name, title, text, onclick) => element("button", { type: "button", class: "way", onclick }, name ? icon(name) : "", element("b", {}, title), element("span", {}, text));
    return [element("div", { class: "ways" },
      way("ground", "Ground, then links", "Set the points that are fixed, then draw links from them.", () => tools.choose("ground")),
      way("link", "Draw a link", "Press at one end, drag to the other. Where ends meet, a joint is made.", () => tools.choose("link")),
      way("effector", "A photograph below", "Draw over a picture, scaled by two clicks.", () => photograph.choose()))];
  }

  // Library mechanisms by their pictures.
  cards(done) {
    const list = element("div", { class: "cards" }, element("span", { class: "soft" }, "…"));
    this.library ??= this.bench.link.ask("library");
    this.library.then(({ mechanisms }) => list.replaceChildren(...mechanisms.map(({ name, title, about, svg }) =>
      element("button", { type: "button", class: "card", title: about, onclick: () => { done(); this.begin(name); } }, drawn(svg), element("b", {}, title || name), element("span", {}, about)))),
    (error) => { this.library = null; list.replaceChildren(element("span", { class: "wrong" }, error.text ?? String(error))); });
    return list;
  }

  async begin(name) {
    this.bench.select(null);
    if (await this.bench.request("start", { name })) { this.bench.tools.choose("select"); this.bench.sheet.fit(); }
  }

  open() {
    const made = this.bench.dialog("Begin with", element("div", { class: "row" },
      button("Empty sheet", "Empty sheet (Undo returns)", () => { made.close(); this.left = null; this.begin(""); }, { class: "main" }),
      button("Photograph below the sheet …", "Lay a photograph under the sheet", () => { made.close(); this.bench.photograph.choose(); })),
    this.cards(() => made.close()));
    made.classList.add("wide");
  }
}
