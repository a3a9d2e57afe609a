import { button, element, quantity } from "./elements.js";

const PLAIN = /^[-+]?[\d._]+(e[-+]?\d+)?\s*([a-zA-Z°µ%][\w°µ^/*% .-]*)?$/i; // a number, perhaps with a unit
const KINDS = { body: "Link", joint: "Joint", point: "Point", prescribed: "Drive", end_effector: "End-effector", linear_spring: "Spring", parameters: "Parameters" };

// Label of a kind of thing: "Linear spring" of "linear_spring".
export const kindLabel = (kind) => KINDS[kind] ?? `${kind[0].toUpperCase()}${kind.slice(1)}`.replaceAll("_", " ");

// The fields of what is selected; without a selection the parameters with sliders.
export class Fields {
  constructor(bench) {
    this.bench = bench;
    this.panel = element("div", { class: "fields" });
    this.keys = "";
    bench.addTab("properties", "Properties", this.panel);
    for (const what of ["state", "selected"]) bench.on(what, () => this.refresh());
  }

  // Places whose fields are shown: of a joint also those of its motor and of other things at it.
  places() {
    const { selected, state } = this.bench;
    if (selected.length > 1) return [];
    if (!selected.length) return [["parameters"]];
    const [chosen] = selected, own = chosen.kind === "joint" ? this.bench.owned(chosen) : [];
    return [this.bench.placeOf(chosen), ...own.filter(([kind]) => kind !== "body" && kind !== "joint")];
  }

  refresh() {
    this.again = true;
    this.asking ??= this.ask();
    return this.asking;
  }

  async ask() {
    do {
      this.again = false;
      const places = this.places();
      const found = await Promise.all(places.map((place) => this.bench.link.ask("fields", { place }).catch((error) => ({ fields: [], error }))));
      if (!this.again) this.show(places, found);
    } while (this.again);
    this.asking = null;
  }

  // Whether an input has a text that was neither sent nor given.
  isTyped(input) { return this.rows?.find((row) => row.input === input)?.isTyped ?? true; }

  // Rows stay while their fields do, so that nobody loses the place where they type.
  show(places, found) {
    const keys = JSON.stringify([places, found.map(({ fields, addable: more }) => [fields.map(({ place, choices }) => [place, choices]), (more ?? []).map(({ label }) => label)]), this.bench.selected]);
    if (keys === this.keys) {
      this.rows.forEach((row, k) => row.update(found.flatMap(({ fields }) => fields)[k]));
      return;
    }
    this.keys = keys;
    this.rows = [];
    this.offer = null;
    const parts = places.map((place, k) => this.section(place, found[k], k));
    this.panel.replaceChildren(...this.head(), ...parts);
  }

  head() {
    const { bench } = this, { selected } = bench;
    if (!selected.length) return [element("p", { class: "soft" }, "Nothing is selected. Parameters of the file:")];
    const drawn = selected.some(({ kind }) => kind === "body" || kind === "point"), on = (made) => (drawn ? made : "");
    const act = element("div", { class: "row" }, ...[
      button("Copy", "Copy (Ctrl+D)", () => bench.copy()), button("Mirror ⇋", "Mirror at the vertical through the origin", () => bench.mirror("y")),
      button("Mirror ⥮", "Mirror at the horizontal through the origin", () => bench.mirror("x"))].map(on), button("Delete", "Delete (Del)", () => bench.remove(), { class: "danger" }));
    if (selected.length > 1) return [element("h2", {}, `${selected.length} things are selected`), element("p", { class: "soft" }, selected.map((one) => bench.nameOf(one)).join(", ")), act];
    return [this.naming(selected[0]), act];
  }

  // The name of what is selected, edited in place.
  naming(chosen) {
    const short = chosen.kind === "point" ? chosen.name.split(".").pop() : chosen.name;
    const input = this.name = element("input", { type: "text", class: "name", value: short, "aria-label": "Name", spellcheck: "false", title: "Name (F2)", disabled: !short });
    const commit = async () => {
      const to = input.value.trim();
      if (!to || to === short || input.dataset.sent === to) return;
      input.dataset.sent = to;
      const [kind] = this.bench.placeOf(chosen), of = chosen.kind === "point" ? "point" : kind;
      if (!await this.bench.act({ kind: "rename", of, name: chosen.name, to })) input.dataset.sent = "";
    };
    input.addEventListener("keydown", ({ key }) => { if (key === "Enter") commit(); if (key === "Escape") { input.value = short; this.bench.sheet.canvas.focus(); } });
    input.addEventListener("blur", commit);
    return element("h2", { class: "naming" }, element("span", {}, kindLabel(chosen.kind)), short ? this.name : "");
  }

  async rename() {
    if (this.bench.selected.length !== 1) return;
    this.bench.showTab("properties");
    await this.refresh();
    this.name?.focus();
    this.name?.select();
  }

  // Puts the cursor into the field of a place, which may be one that is not in the file yet.
  async focus(place) {
    await this.refresh();
    const found = this.rows?.find(({ field }) => String(field.place) === String(place));
    if (found) found.input.focus(); else this.offer?.(place.at(-1));
  }

  section(place, { fields, addable: more, error }, number) {
    const slides = place[0] === "parameters", part = element("section", {});
    if (number) {
      const [kind, name] = place;
      part.append(element("h3", {}, `${kindLabel(kind)} `, element("b", {}, name), button("×", `Delete ${kind} ${name}`, () => this.bench.remove([{ kind, name }]), { class: "icon small" })));
    }
    for (const field of fields) {
      const row = new Row(this.bench, field, slides);
      this.rows.push(row);
      part.append(row.box);
    }
    if (error && !slides) part.append(element("p", { class: "wrong" }, error.text ?? String(error)));
    if (slides) part.append(this.newParameter(fields));
    else if (more?.length) part.append(this.adder(place, more));
    return part;
  }

  // Fields that may be added.
  adder(place, more) {
    const made = element("select", { class: "more", "aria-label": "Add a field" }, element("option", { value: "" }, "Add a field …"));
    for (const { label, help, unit } of more) made.append(element("option", { value: label, title: help ?? "" }, unit ? `${label} [${unit}]` : label));
    const offer = (wanted) => {
      const chosen = more.find(({ label }) => label === wanted);
      if (!chosen) return;
      const row = new Row(this.bench, { place: chosen.place ?? [...place, chosen.label], label: chosen.label, text: "", unit: chosen.unit, help: chosen.help, choices: chosen.choices, optional: true });
      made.before(row.box);
      row.input.focus();
    };
    made.addEventListener("change", () => { offer(made.value); made.value = ""; });
    this.offer ??= offer;
    return made;
  }

  newParameter(fields) {
    const free = (k = 1) => (fields.some(({ label }) => label === `p${k}`) ? free(k + 1) : `p${k}`);
    return button("Add a parameter", "A number with a name: fields may be expressions of it", () => this.bench.act({ kind: "set", place: ["parameters", free()], text: "100 mm" }), { class: "more" });
  }
}

// One number, name or choice: its text as in the file, its unit and value, and what is wrong with it.
class Row {
  constructor(bench, field, slides = false) {
    this.bench = bench;
    this.wrong = element("small", { class: "wrong", role: "alert", hidden: true });
    this.value = element("small", { class: "value" });
    this.input = field.choices?.length ? this.choice(field) : element("input", { type: "text", spellcheck: "false", autocomplete: "off" });
    this.input.setAttribute("aria-label", field.label);
    const listen = (what, does) => this.input.addEventListener(what, does);
    listen("change", () => this.commit());
    listen("keydown", (event) => this.key(event));
    const label = element("span", { class: "label", title: field.help ?? "" }, /^\d$/.test(field.label) ? `point ${field.label}` : field.label);
    const remove = field.optional ? button("×", `Remove ${field.label}`, () => this.remove(), { class: "icon small" }) : null;
    this.box = element("label", { class: "field", title: field.help ?? "" }, label, this.input, element("span", { class: "unit" }, field.unit ?? ""), remove, this.value, this.wrong);
    if (slides && Number.isFinite(field.value) && PLAIN.test(field.text)) this.addSlider(field);
    this.update(field);
  }

  choice({ choices, text }) {
    const made = element("select", {}), all = choices.includes(text) || !text ? choices : [text, ...choices];
    if (!text) made.append(element("option", { value: "" }, "choose …"));
    for (const one of all) made.append(element("option", { value: one }, one));
    return made;
  }

  update(field) {
    // Several steps may have passed since the last update; a text that was refused stays until the field changes.
    const text = field.text ?? "", stale = this.wrong.hidden ? text !== this.input.value : text !== (this.field.text ?? "");
    this.field = field;
    if (stale && !this.isTyped) { this.input.value = this.known = text; this.setWrong(""); }
    const evaluated = typeof field.value === "number" && !PLAIN.test(String(field.text ?? "").trim());
    this.value.textContent = evaluated ? `= ${quantity(field.value, field.unit ?? "", 6)}` : "";
    if (this.range && document.activeElement !== this.range && Number.isFinite(field.value)) this.range.value = field.value;
  }

  get isTyped() { return document.activeElement === this.input && this.input.value !== this.known; }

  key(event) {
    if (event.key === "Enter") this.commit();
    if (event.key === "Escape") { this.input.value = this.field.text ?? ""; this.setWrong(""); this.bench.sheet.canvas.focus(); event.stopPropagation(); }
  }

  async commit(more = {}) {
    const text = this.input.value.trim(), { place } = this.field;
    if (text === this.field.text && this.wrong.hidden) return;
    if (text === this.sent && this.pending) return;
    this.sent = text;
    this.known = this.input.value;
    this.pending = true;
    try {
      const action = text || !this.field.optional ? { kind: "set", place, text } : { kind: "unset", place };
      const state = await this.bench.link.ask("act", { action, ...more });
      this.setWrong("");
      this.bench.take(state);
      this.bench.say(state.note ?? "");
    } catch (error) { this.setWrong(error.text ?? String(error)); }
    this.pending = false;
  }

  setWrong(text) {
    this.wrong.hidden = !text;
    this.wrong.textContent = text;
    if (text) this.input.setAttribute("aria-invalid", "true"); else this.input.removeAttribute("aria-invalid");
  }

  async remove() {
    if (this.field.text) await this.bench.act({ kind: "unset", place: this.field.place });
    else this.box.remove();
  }

  // A slider from nothing to twice the number, in its own unit; all of one movement is one step of the history.
  addSlider(field) {
    const number = parseFloat(field.text), unit = field.text.replace(/^[-+]?[\d._]+(e[-+]?\d+)?/i, ""), per = field.value / number || 1;
    const [low, high] = field.value ? [Math.min(0, 2 * field.value), Math.max(0, 2 * field.value)] : [-1, 1];
    this.range = element("input", { type: "range", min: low, max: high, step: "any", value: field.value, "aria-label": `${field.label} slider` });
    let moving = 0, flight = null, waits = false;
    const send = async () => {
      if (flight) { waits = true; return; }
      do { waits = false; flight = this.commit({ live: `${field.label} ${moving}` }); await flight; } while (waits);
      flight = null;
    };
    this.range.addEventListener("pointerdown", () => { moving++; });
    this.range.addEventListener("input", () => { this.input.value = `${+(this.range.valueAsNumber / per).toPrecision(4)}${unit}`; send(); });
    this.box.append(this.range);
  }
}
