import { Colours } from "./colours.js";
import { button, element } from "./elements.js";
import { Link, socketPort } from "./link.js";
import { Sheet } from "./sheet.js";

// The page: what all parts share, where they stand, and the keys.
class Workbench {
  constructor(port, root) {
    this.root = root;
    root.classList.add("workbench");
    this.colours = new Colours(root);
    this.link = new Link(port);
    this.state = { text: "", picture: null, revision: -1 };
    this.looks = {};
    this.selected = []; // [{kind, name}], kinds as of outline and picture
    this.listeners = { state: [], selected: [], picture: [] };
    this.link.on("state", ({ state }) => this.take(state));
    this.link.on("end", ({ text }) => this.say(text, "error"));
    this.sheet = new Sheet(this);
    this.layOut();
  }

  on(what, listener) { this.listeners[what].push(listener); }
  notify(what) { for (const listener of this.listeners[what]) listener(); this.sheet.repaint(); }

  layOut() {
    this.parts = {
      bar: element("header", { class: "bar" }), tools: element("nav", { class: "tools", "aria-label": "Tools" }),
      stage: element("section", { class: "stage", "aria-label": "Sheet" }, this.sheet.canvas),
      side: element("aside", { class: "side", "aria-label": "Numbers" }), dock: element("footer", { class: "dock" }),
    };
    this.message = element("p", { class: "message", role: "status", "aria-live": "polite" });
    this.parts.stage.append(this.message);
    this.root.replaceChildren(...Object.values(this.parts));
    this.parts.bar.append(
      element("strong", { class: "brand" }, "paraflex"),
      button("↶", "Undo (Ctrl+Z)", () => this.step("undo")), button("↷", "Redo (Ctrl+Shift+Z)", () => this.step("redo")),
    );
  }

  async begin() {
    const { looks, recovered, ...state } = await this.link.ask("open");
    this.looks = looks;
    this.take(state);
    this.sheet.fit();
    if (recovered) this.say("Unsaved work of the last time is here again; Undo returns to the file.");
  }

  // The state of the document; replies and events both bring it.
  take(state) {
    if (state.revision === this.state.revision) return;
    const empty = !this.state.picture;
    this.state = state;
    this.selected = this.selected.filter(({ kind, name }) => this.exists(kind, name));
    this.notify("state");
    if (empty && state.picture) this.sheet.fit();
  }

  exists(kind, name) {
    const { picture } = this.state;
    if (!picture) return false;
    const known = { body: picture.bodies, joint: picture.joints, point: picture.points }[kind];
    return !known || known.some(([one]) => one === name);
  }

  isSelected(kind, name) { return this.selected.some((one) => one.kind === kind && one.name === name); }

  select(chosen, more = false) {
    this.selected = chosen ? (more ? [...this.selected, chosen] : [chosen]) : [];
    this.notify("selected");
  }

  // What a person does: an action on the text; a refusal is shown, and null returned.
  async act(action) { return this.request("act", { action }); }
  async step(which) { return this.request(which); }

  async request(what, fields = {}) {
    try {
      const found = await this.link.ask(what, fields);
      if ("revision" in found) this.take(found);
      this.say(found.note ?? "");
      return found;
    } catch (error) {
      this.say(error.text ?? String(error), "error");
      return null;
    }
  }

  say(text, kind = "note") {
    this.message.textContent = text;
    this.message.dataset.kind = kind;
  }
}

// The entry of anywidget, and of the page that this machine serves.
function render({ model, el }) {
  const root = element("div");
  el.append(root);
  const bench = new Workbench(model, root);
  bench.begin();
  return bench;
}

if (document.body?.hasAttribute("data-workbench")) {
  const port = socketPort(`${location.href.replace(/^http/, "ws").replace(/[?#].*$/, "")}socket`);
  const bench = render({ model: port, el: document.getElementById("workbench") });
  port.onEnd(() => bench.link.end("paraflex edit has ended; unsaved work is kept as a draft"));
  window.workbench = bench;
}

export default { render: (given) => { render(given); } };
