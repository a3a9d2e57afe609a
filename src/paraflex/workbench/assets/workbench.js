import { Colours } from "./colours.js";
import { button, element } from "./elements.js";
import { Fields } from "./fields.js";
import { Leave } from "./leave.js";
import { Link, socketPort } from "./link.js";
import { Motion } from "./motion.js";
import { Outline } from "./outline.js";
import { Photograph } from "./photograph.js";
import { Seeing } from "./seeing.js";
import { Sheet } from "./sheet.js";
import { Start } from "./start.js";
import { TextPane } from "./text.js";
import { Tools } from "./tools.js";

const THEMES = ["auto", "light", "dark"];
const CHECKED = 300; // time after a change until all checks are made [ms]
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const KEYS = [
  ["Letters", "tools, as beside their names"], ["Escape", "ends what was begun; then the select tool"], ["Enter", "ends a link or path of several points; sets a point at the cursor of the arrows"],
  ["Arrows", "move what is selected by one step of the grid, or the cursor of a drawing tool"], ["Alt", "no snapping to the grid"], ["Shift", "adds to the selection; a link with more points"],
  ["Delete", "deletes the selection"], ["F2", "renames it"], ["Ctrl+D", "copies it"], ["Ctrl+Z, Ctrl+Y", "undo and redo"], ["Ctrl+S", "saves"], ["Space", "plays the motion; held while dragging it moves the sheet"],
  ["Arrows on the slider of time", "frame by frame; with Shift ten at a time"], ["0 or Home", "shows all"], ["Wheel, two fingers", "zoom; the middle button moves the sheet"],
];

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
    this.listeners = { state: [], selected: [], picture: [], reach: [] };
    this.tabs = new Map();
    this.link.on("state", ({ state }) => this.take(state));
    this.link.on("end", ({ text }) => this.say(text, "error"));
    this.sheet = new Sheet(this);
    this.layOut();
    this.tools = new Tools(this);
    this.fields = new Fields(this);
    this.outline = new Outline(this);
    this.text = new TextPane(this);
    this.photograph = new Photograph(this);
    this.start = new Start(this);
    for (const Part of [Seeing, Motion, Leave]) new Part(this);
    this.showTab("properties");
    const page = document.body?.hasAttribute("data-workbench");
    (page ? document : root).addEventListener("keydown", (event) => this.pressed(event));
    (page ? document : root).addEventListener("keyup", (event) => this.released(event));
    this.on("state", () => this.shown());
  }

  on(what, listener) { this.listeners[what].push(listener); }
  notify(what) { for (const listener of this.listeners[what]) listener(); this.sheet.repaint(); }

  layOut() {
    this.strip = element("div", { class: "tabs", role: "tablist", "aria-label": "Panels" });
    this.message = element("p", { class: "message", role: "status", "aria-live": "polite" });
    this.parts = {
      bar: element("header", { class: "bar" }), tools: element("nav", { class: "tools", "aria-label": "Tools" }),
      stage: element("section", { class: "stage", "aria-label": "Sheet" }, this.sheet.canvas, this.message),
      side: element("aside", { class: "side", "aria-label": "Numbers" }, this.strip), dock: element("footer", { class: "dock" }),
    };
    this.root.replaceChildren(...Object.values(this.parts));
    this.parts.side.append(this.divider());
    this.title = element("button", { type: "button", class: "title", title: "Save (Ctrl+S)", onclick: () => this.save() });
    this.steps = { undo: button("↶", "Undo (Ctrl+Z)", () => this.step("undo"), { class: "icon" }), redo: button("↷", "Redo (Ctrl+Shift+Z)", () => this.step("redo"), { class: "icon" }) };
    this.parts.bar.append(
      element("strong", { class: "brand" }, "paraflex"), this.title,
      button("New", "Begin with an empty sheet, a mechanism of the library or a photograph", () => this.start.open()),
      button("Save", "Save (Ctrl+S)", () => this.save()), this.steps.undo, this.steps.redo, element("span", { class: "gap" }),
      button("⤢", "Show all (0)", () => this.sheet.fit(), { class: "icon" }), button("+", "Zoom in", () => this.sheet.zoom(1.25), { class: "icon" }), button("−", "Zoom out", () => this.sheet.zoom(0.8), { class: "icon" }),
      this.toggle("#", "Grid", "grid"), this.toggle("Aa", "Names", "names"),
      button("◐", "Theme: light, dark or that of the system", () => this.nextTheme(), { class: "icon" }), button("?", "Keys", () => this.showKeys(), { class: "icon" }),
    );
  }

  // The left edge of the side panel, which is dragged or moved by arrows.
  divider() {
    const made = element("div", { class: "divider", role: "separator", tabindex: "0", "aria-orientation": "vertical", "aria-label": "Width of the panel", title: "Drag, or use arrows: width of the panel" });
    const widen = (width) => this.root.style.setProperty("--side", `${Math.min(Math.max(width, 240), 0.7 * this.root.clientWidth)}px`);
    made.addEventListener("pointerdown", ({ pointerId }) => made.setPointerCapture(pointerId));
    made.addEventListener("pointermove", ({ clientX, pointerId }) => { if (made.hasPointerCapture(pointerId)) widen(this.root.getBoundingClientRect().right - clientX); });
    made.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: 20, ArrowRight: -20 }[event.key];
      if (!by) return;
      widen(this.parts.side.clientWidth + by);
      event.preventDefault();
    });
    return made;
  }

  toggle(text, title, what) {
    const made = button(text, title, () => {
      this.sheet[what] = !this.sheet[what];
      made.setAttribute("aria-pressed", this.sheet[what]);
      this.sheet.repaint();
    }, { class: "icon", "aria-pressed": "true" });
    return made;
  }

  nextTheme() {
    const next = THEMES[(THEMES.indexOf(this.root.dataset.theme) + 1) % THEMES.length];
    this.colours.set(next);
    this.say(`Theme: ${next === "auto" ? "that of the system" : next}`);
  }

  // A panel at the side with its tab; the first one is shown.
  addTab(key, label, panel) {
    const tab = element("button", { type: "button", role: "tab", "aria-selected": "false", onclick: () => this.showTab(key) }, label);
    panel.setAttribute("role", "tabpanel");
    panel.setAttribute("aria-label", label);
    panel.classList.add("panel");
    panel.hidden = true;
    this.tabs.set(key, { tab, panel });
    this.strip.append(tab);
    this.parts.side.append(panel);
  }

  showTab(key) {
    this.tab = key;
    for (const [name, { tab, panel }] of this.tabs) {
      tab.setAttribute("aria-selected", name === key);
      panel.hidden = name !== key;
    }
    this.tabs.get(key)?.panel.dispatchEvent(new Event("shown"));
  }

  async begin() {
    const slow = setTimeout(() => this.say("Opening; the first time after an installation this takes half a minute …"), 700);
    const { looks, recovered, ...state } = await this.link.ask("open");
    clearTimeout(slow);
    this.say("");
    this.looks = looks;
    this.take(state);
    this.sheet.fit();
    if (recovered) this.say("Unsaved work of the last time is here again; Undo returns to the file.");
  }

  // The state of the document; replies and events both bring it.
  take(state) {
    if (state.revision <= this.state.revision) return;
    const empty = !this.isDrawn;
    this.state = state;
    this.selected = this.selected.filter(({ kind, name }) => this.exists(kind, name));
    this.notify("state");
    this.reach();
    if (empty && this.isDrawn && !this.tools.isDrawing) this.sheet.fit();
  }

  // Where the path is reached takes longer than other numbers; what waits for it is notified in any case.
  async reach() {
    const { state } = this;
    if (state.seen && !state.seen.path) {
      const found = await this.link.ask("reach").catch(() => ({ path: [], ready: state.ready }));
      if (state !== this.state) return;
      state.seen.path = found.path;
      state.ready = found.ready;
    }
    this.notify("reach");
    clearTimeout(this.checking);
    if (state.ready?.ok && !state.findings) this.checking = setTimeout(() => this.check(), CHECKED);
  }

  // What `paraflex info` finds takes longer still; the line of readiness has it if a run would be wrong.
  async check() {
    const { state } = this, found = await this.link.ask("check").catch(() => null);
    if (!found || state !== this.state) return;
    state.findings = found.findings;
    if (!found.ok) state.ready = found;
    this.notify("reach");
  }

  // Whether the sheet has any link.
  get isDrawn() { return (this.state.picture?.bodies ?? []).length > 0; }

  shown() {
    const { name, saved, undo, redo } = this.state;
    this.title.textContent = `${(name ?? "untitled").split(/[\\/]/).pop()}${saved ? "" : " •"}`;
    this.title.title = saved ? "Saved" : "Not saved yet: Ctrl+S";
    this.steps.undo.disabled = !undo;
    this.steps.redo.disabled = !redo;
  }

  exists(kind, name) {
    const { picture, outline } = this.state;
    const known = picture && { body: picture.bodies, joint: picture.joints, point: picture.points }[kind];
    if (known) return known.some(([one]) => one === name);
    return (outline ?? []).some((one) => one.kind === kind && one.name === name);
  }

  isSelected(kind, name) { return this.selected.some((one) => one.kind === kind && one.name === name); }

  select(chosen, more = false) {
    const already = chosen && this.isSelected(chosen.kind, chosen.name);
    if (more && already) this.selected = this.selected.filter((one) => one.kind !== chosen.kind || one.name !== chosen.name);
    else this.selected = chosen ? (more ? [...this.selected, chosen] : [chosen]) : [];
    this.notify("selected");
  }

  // Select what a text such as "body.link1", "ground.A" or "end_effector" names.
  selectNamed(text) {
    const [kind, ...rest] = text.split("."), name = rest.join(".");
    if (kind === "parameters") return;
    const ofBody = (this.state.picture?.bodies ?? []).some(([body]) => body === kind) && name;
    const chosen = kind === "ground" || ofBody ? { kind: "point", name: text } : { kind, name };
    if (this.exists(chosen.kind, chosen.name)) this.select(chosen);
  }

  // Place in the file, and name in messages, of something selected.
  placeOf({ kind, name }) {
    if (kind !== "point") return name && name !== kind ? [kind, name] : [kind];
    const [body, point] = name.split(".");
    return body === "ground" ? ["ground", point] : ["body", body, "points", point];
  }
  nameOf(chosen) { return chosen.kind === "point" ? chosen.name : this.placeOf(chosen).join("."); }
  owned({ kind, name }) { return (this.state.outline ?? []).find((one) => one.kind === kind && one.name === name)?.owns ?? []; }

  // Go to a place in the file: select what stands there, and its field.
  goTo(place) {
    const [kind, name, ...rest] = place;
    if (kind === "parameters") this.select(null);
    else this.selectNamed([kind, name].filter((one) => one !== undefined).join("."));
    this.showTab("properties");
    this.fields.focus([kind, name, ...rest]);
  }

  // Something was selected on the sheet: its fields are shown unless the file is.
  fieldsWanted() { if (this.tab === "model") this.showTab("properties"); }

  // What a person does: an action on the text; a refusal is shown, and null returned.
  async act(action, more = {}) { return this.request("act", { action, ...more }); }
  // Several actions as one step; "@" stands for what the one before has made.
  async actAll(...actions) { return this.request("act", { actions }); }

  async step(which) {
    await this.text.flush();
    return this.request(which);
  }

  async request(what, fields = {}) {
    try {
      const found = await this.link.ask(what, fields);
      if ("revision" in found) this.take(found);
      if (found.selected) this.selectNamed(found.selected);
      this.say(found.note ?? "");
      return found;
    } catch (error) {
      this.say(error.text ?? String(error), "error");
      return null;
    }
  }

  say(text, kind = "note") {
    this.question = null;
    this.message.replaceChildren(text);
    this.message.dataset.kind = kind;
  }

  // A question in the message line, which Enter answers with yes and Escape with no.
  ask(text, yes, label) {
    this.say(text, "question");
    const answer = (given) => { this.say(""); if (given) yes(); this.sheet.canvas.focus(); };
    this.message.append(" ", button(`${label} ⏎`, label, () => answer(true), { class: "main" }), button("Keep", "Keep (Escape)", () => answer(false)));
    this.question = answer;
  }

  async save(name) {
    await this.text.flush();
    if (name === undefined && !this.state.file) return this.askName();
    const found = await this.request("save", name === undefined ? {} : { name });
    if (found && !found.note) this.say(`Saved as ${this.state.file}${this.state.problem ? "; it is not a model yet" : ""}`);
    return null;
  }

  askName() {
    const input = element("input", { type: "text", value: "mine.toml", "aria-label": "Name of the file", spellcheck: "false" });
    const made = this.dialog("Save as", element("p", {}, "Name of the model file, in the folder in which paraflex edit was started:"), input,
      button("Save", "Save", () => done(), { class: "main" }));
    const done = () => { made.close(); this.save(input.value.trim()); };
    input.addEventListener("keydown", (event) => { if (event.key === "Enter") done(); });
    input.select();
  }

  dialog(title, ...content) {
    const made = element("dialog", { "aria-label": title, onclose: () => made.remove() },
      element("header", {}, element("h2", {}, title), button("×", "Close (Escape)", () => made.close(), { class: "icon" })), ...content);
    this.root.append(made);
    made.showModal();
    return made;
  }

  showKeys() {
    const list = element("dl", { class: "keys" });
    for (const [keys, text] of KEYS) list.append(element("dt", {}, keys), element("dd", {}, text));
    this.dialog("Keys", list);
  }

  async remove(chosen = this.selected) {
    const names = chosen.map((one) => this.nameOf(one));
    if (!names.length) return;
    const found = await this.request("goes", { names });
    if (!found) return;
    const go = () => this.act({ kind: "delete", names });
    const more = [...new Set(found.goes.filter(({ name }) => !names.includes(name)).map(({ kind, name, place }) => (place.length > 2 && kind !== "body" ? `an entry of ${kind}` : name.replace(".", " "))))];
    if (!more.length) go();
    else this.ask(`deletes ${listed(more)} as well`, go, "Delete");
  }

  copy() {
    const by = 2 * this.sheet.step;
    this.double({ kind: "copy", by: [by, -by] });
  }

  mirror(axis) { this.double({ kind: "mirror", axis, about: 0 }); }

  // What a copy or an image adds is selected.
  async double(action) {
    const { bodies, points } = this.state.picture ?? {}, before = new Set([...(bodies ?? []), ...(points ?? [])].map(([name]) => name));
    if (!this.selected.length || !await this.act({ ...action, names: this.selected.map((one) => this.nameOf(one)) })) return;
    const fresh = (kind, all) => all.map(([name]) => name).filter((name) => !before.has(name) && (kind === "body" || name.startsWith("ground."))).map((name) => ({ kind, name }));
    const { picture } = this.state;
    this.selected = [...fresh("body", picture.bodies), ...fresh("point", picture.points)];
    this.notify("selected");
  }

  nudge([dx, dy]) {
    const names = this.selected.map((one) => (one.kind === "body" ? this.nameOf(one) : this.sheet.places.pointOf(one)?.[0])).filter(Boolean), { step } = this.sheet;
    if (!names.length) return false;
    this.act({ kind: "move", names, by: [dx * step, dy * step] });
    return true;
  }

  pressed(event) {
    event.stopPropagation(); // a notebook has keys of its own
    const { target, key } = event, field = target.closest?.("input, textarea, select, dialog"), control = event.ctrlKey || event.metaKey;
    if (control) {
      const letter = key.toLowerCase();
      const act = { z: () => this.step(event.shiftKey ? "redo" : "undo"), y: () => this.step("redo"), s: () => this.save(), d: () => this.copy() }[letter];
      // What is being typed has a history of its own.
      const typing = field && field !== this.text.area && this.fields.isTyped(field);
      if (!act || (field && letter === "d") || (typing && letter !== "s")) return;
      event.preventDefault();
      act();
      return;
    }
    if (field || event.defaultPrevented) return;
    if (this.question && (key === "Enter" || key === "Escape")) { this.question(key === "Enter"); event.preventDefault(); return; }
    if ((key === " " || key === "Enter") && target.closest?.("button, a, summary")) return;
    if (this.command(event)) event.preventDefault();
  }

  // What a key does on the sheet; whether it did anything.
  command(event) {
    const { key } = event;
    if (ARROWS[key]) return this.tools.arrow(ARROWS[key]) || this.nudge(ARROWS[key]);
    if (key === " ") { this.tools.space(true); return true; }
    if (key === "Delete" || key === "Backspace") { this.remove(); return true; }
    if (key === "F2") { this.fields.rename(); return true; }
    if (key === "Escape") { this.tools.escape(); return true; }
    if (key === "Enter") { this.tools.enter(); return true; }
    if (key === "?") { this.showKeys(); return true; }
    if (key === "0" || key === "Home") { this.sheet.fit(); return true; }
    return key.length === 1 && !event.altKey && this.tools.chooseByKey(key);
  }

  released({ key, target }) {
    if (key !== " " || target.closest?.("input, textarea, select, button, dialog")) return;
    if (!this.tools.space(false)) this.motion?.toggle();
  }
}

// Names in one sentence: "a, b and c".
function listed(names) { return names.length < 2 ? names.join("") : `${names.slice(0, -1).join(", ")} and ${names.at(-1)}`; }

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
