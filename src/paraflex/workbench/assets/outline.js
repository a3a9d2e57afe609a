import { button, element } from "./elements.js";
import { kindLabel } from "./fields.js";

// Things that have no place on the sheet, and how they are added.
const ADDABLE = [
  ["Parameter", "parameters", "p", { text: "100 mm" }], ["Section", "section", "bar", { value: { width: "30 mm", thickness: "5 mm" } }],
  ["Material", "material", "steel", { value: { youngs_modulus: "210 GPa", density: 7850 } }], ["Lump", "lump", "pin", { value: { mass: "0.1 kg", inertia: "20 kg mm^2" } }],
  ["Gravity"], ["Mode of all motors"],
];

// All things of the file in groups; a click selects, the cross deletes.
export class Outline {
  constructor(bench) {
    this.bench = bench;
    this.panel = element("div", { class: "outline" });
    bench.addTab("model", "Model", this.panel);
    for (const what of ["state", "selected"]) bench.on(what, () => this.show());
  }

  show() {
    const groups = new Map();
    for (const one of this.bench.state.outline ?? []) groups.set(one.kind, [...(groups.get(one.kind) ?? []), one]);
    this.panel.replaceChildren(this.adder(), ...[...groups].map(([kind, things]) => this.group(kind, things)));
  }

  group(kind, things) {
    const list = element("ul", {});
    for (const { name, place } of things) {
      const chosen = this.chosenOf(kind, name), text = name || kindLabel(kind);
      list.append(element("li", {},
        element("button", { type: "button", class: "thing", "aria-pressed": this.bench.isSelected(chosen.kind, chosen.name), onclick: ({ shiftKey }) => { this.bench.select(chosen, shiftKey); } }, text),
        button("✎", `Properties of ${text}`, () => { this.bench.select(chosen); this.bench.showTab("properties"); }, { class: "icon small" }),
        button("≡", `Show ${text} in the file`, () => { this.bench.select(chosen); this.bench.showTab("file"); this.bench.text.reveal(place); }, { class: "icon small" }),
        button("×", `Delete ${text}`, () => this.bench.remove([chosen]), { class: "icon small" })));
    }
    return element("details", { open: true }, element("summary", {}, `${kindLabel(kind)} `, element("small", {}, `${things.length}`)), list);
  }

  chosenOf(kind, name) { return kind === "ground" ? { kind: "point", name: `ground.${name}` } : { kind, name }; }

  adder() {
    const made = element("select", { class: "more", "aria-label": "Add" }, element("option", { value: "" }, "Add …"));
    ADDABLE.forEach(([label], k) => made.append(element("option", { value: k }, label)));
    made.addEventListener("change", async () => {
      const [label, table, stem, content] = ADDABLE[made.value];
      made.value = "";
      const motors = (this.bench.state.outline ?? []).filter(({ kind }) => kind === "motor").map(({ name }) => name);
      const action = table ? { kind: "set", place: [table, this.fresh(table, stem)], ...content } : label === "Gravity" ? { kind: "add-gravity" } : { kind: "add-mode", motors };
      const found = await this.bench.act(action);
      if (found?.selected) this.bench.showTab("properties");
    });
    return made;
  }

  fresh(table, stem) {
    const taken = new Set((this.bench.state.outline ?? []).filter(({ kind }) => kind === table).map(({ name }) => name));
    let k = 1;
    while (taken.has(k > 1 || table === "parameters" ? `${stem}${k}` : stem)) k++;
    return k > 1 || table === "parameters" ? `${stem}${k}` : stem;
  }
}
