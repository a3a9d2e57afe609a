import { button, element } from "./elements.js";

// What a person takes away: a menu at the right of the bar.
const WAYS = [
  ["report", "Report", "a page with all charts and tables, opened in a new tab"], ["svg", "Figure, SVG", "drawing for print"], ["pdf", "Figure, PDF", "drawing for print"], ["png", "Figure, PNG", "drawing as a picture"],
  ["film", "Film", "the motion as an animated picture"], ["program", "Python program", "code that makes the same mechanism"], ["link", "Link", "opens the same model again"],
];

export class Leave {
  constructor(bench) {
    this.bench = bench;
    this.menu = element("div", { class: "menu", role: "menu", "aria-label": "Leave", hidden: true }, ...WAYS.map(([what, label, about]) =>
      element("button", { type: "button", role: "menuitem", onclick: () => this.leave(what, label) }, element("b", {}, label), element("small", {}, about))));
    this.opener = button("Export ▾", "Report, figures, film, Python program, link", () => this.open(this.menu.hidden), { "aria-haspopup": "menu", "aria-expanded": "false", class: "leave" });
    bench.parts.bar.append(element("div", { class: "leaving" }, this.opener, this.menu));
    this.menu.addEventListener("keydown", (event) => this.pressed(event));
    bench.root.addEventListener("pointerdown", ({ target }) => { if (!target.closest?.(".leaving")) this.open(false); });
  }

  open(on) {
    this.menu.hidden = !on;
    this.opener.setAttribute("aria-expanded", on);
    if (on) this.menu.firstChild.focus();
  }

  pressed(event) {
    const items = [...this.menu.children], k = items.indexOf(event.target), to = { ArrowDown: k + 1, ArrowUp: k - 1, Home: 0, End: items.length - 1 }[event.key];
    if (event.key === "Escape") { this.open(false); this.opener.focus(); } else if (to !== undefined) items[(to + items.length) % items.length].focus();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  // What takes a while is announced; a report is opened, files are downloaded, texts are shown to be copied.
  async leave(what, label) {
    this.open(false);
    await this.bench.text?.flush?.();
    // A tab that opens later than the click is held back by browsers.
    const tab = what === "report" ? globalThis.open("about:blank", "_blank") : null;
    this.bench.say(`${label} is being made …`);
    this.opener.disabled = true;
    const found = await this.bench.request("leave", { what });
    this.opener.disabled = false;
    if (!found) { tab?.close(); return; }
    // A notebook has no server: the file itself is in the reply.
    if (found.data) found.address = URL.createObjectURL(new Blob([Uint8Array.from(atob(found.data), (one) => one.charCodeAt(0))], { type: tab ? "text/html" : "" }));
    if (found.text !== undefined) this.showText(what, label, found.text);
    else if (tab) { tab.location = new URL(found.address, location.href); this.bench.say("The report is in a new tab."); } else this.offer(what, label, found);
  }

  offer(what, label, { address, file }) {
    const name = (file ?? address).split(/[\\/]/).pop(), link = element("a", { href: address, ...(what === "report" ? { target: "_blank" } : { download: name }) }, `${label}: ${name}`);
    if (what !== "report") link.click();
    this.bench.say("");
    this.bench.message.append(link);
    this.bench.message.dataset.kind = "question";
  }

  showText(what, label, text) {
    const area = element("textarea", { readonly: true, rows: what === "link" ? 4 : 22, spellcheck: "false", "aria-label": label }), copy = button("Copy", "Copy the whole text", async () => {
      try { await navigator.clipboard.writeText(area.value); } catch { area.select(); document.execCommand("copy"); }
      copy.textContent = "Copied";
    }, { class: "main" });
    area.value = text;
    this.bench.say("");
    this.bench.dialog(label, area, copy).classList.add("wide", "text");
  }
}
