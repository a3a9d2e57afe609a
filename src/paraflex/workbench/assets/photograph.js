import { button, element } from "./elements.js";

const UNITS = { "": 1, m: 1, mm: 1e-3, cm: 1e-2, um: 1e-6, "µm": 1e-6, in: 0.0254, ft: 0.3048 };
const lengthOf = (text) => {
  const [, number, unit] = /^\s*([\d.]+(?:e[-+]?\d+)?)\s*([a-zµ]*)\s*$/i.exec(text) ?? [];
  return number && unit in UNITS && +number > 0 ? +number * UNITS[unit] : null;
};

// A photograph under the grid, to draw over; it stays in this page.
export class Photograph {
  constructor(bench) {
    this.bench = bench;
    this.image = null;
    this.place = [0, 0]; // middle [m]
    this.size = 1e-3; // m/px of the image
    this.alpha = 0.5;
    const opacity = element("input", { type: "range", min: "0", max: "1", step: "0.05", value: "0.5", "aria-label": "Opacity of the photograph" });
    opacity.addEventListener("input", () => { this.alpha = opacity.valueAsNumber; bench.sheet.repaint(); });
    this.panel = element("div", { class: "photo", hidden: true }, element("label", {}, "Photograph ", opacity),
      button("Scale …", "Click two points of the photograph and give their distance", () => this.scale()), button("Place …", "Click a point of the photograph, then where it shall be", () => this.move()),
      button("×", "Remove the photograph", () => this.take(null), { class: "icon small" }));
    this.input = element("input", { type: "file", accept: "image/*", hidden: true });
    this.input.addEventListener("change", () => { this.load(this.input.files[0]); this.input.value = ""; });
    const { stage } = bench.parts;
    stage.append(this.panel, this.input);
    stage.addEventListener("dragover", (event) => event.preventDefault());
    stage.addEventListener("drop", (event) => { event.preventDefault(); this.load(event.dataTransfer.files[0]); });
    bench.sheet.behind.push((pen) => this.paint(pen));
  }

  choose() { this.input.click(); }

  async load(file) {
    if (!file) return;
    try { this.take(await createImageBitmap(file)); } catch { this.bench.say(`${file.name}: not an image that this browser reads`, "error"); }
  }

  take(image) {
    this.image = image;
    this.panel.hidden = !image;
    const { sheet } = this.bench;
    this.bench.start.hide();
    if (image) {
      this.size = 0.8 * Math.min(sheet.width / image.width, sheet.height / image.height) / sheet.scale;
      this.place = [...sheet.centre];
      this.bench.say("");
      this.scale();
    }
    sheet.repaint();
  }

  scale() { this.bench.tools.pick(2, "Click two points of the photograph whose distance you know.", (a, b) => this.askLength(a, b)); }
  move() { this.bench.tools.pick(2, "Click a point of the photograph, then the place where it shall be.", ([ax, ay], [bx, by]) => { this.place = [this.place[0] + bx - ax, this.place[1] + by - ay]; this.bench.sheet.repaint(); }); }

  askLength(a, b) {
    const far = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (!far) return;
    const input = element("input", { type: "text", value: "80 mm", "aria-label": "Distance", spellcheck: "false" }), wrong = element("p", { class: "wrong", role: "alert" });
    const done = () => {
      const length = lengthOf(input.value);
      if (!length) { wrong.textContent = "not a length: give one such as 80 mm, 12 cm or 3 in"; return; }
      const factor = length / far;
      this.place = [0, 1].map((k) => a[k] + factor * (this.place[k] - a[k]));
      this.size *= factor;
      made.close();
      this.bench.sheet.show(this.limits);
    };
    const made = this.bench.dialog("Scale of the photograph", element("p", {}, "Distance of the two points:"), input, wrong, button("Scale", "Scale", done, { class: "main" }));
    input.addEventListener("keydown", ({ key }) => { if (key === "Enter") done(); });
    input.select();
  }

  get limits() {
    const wide = this.size * this.image.width / 2, high = this.size * this.image.height / 2, [x, y] = this.place;
    return [x - wide, y - high, x + wide, y + high];
  }

  paint(pen) {
    if (!this.image) return;
    const { sheet } = this.bench, [left, bottom, right, top] = this.limits, [x, y] = sheet.px(left, top), [x1, y1] = sheet.px(right, bottom);
    pen.globalAlpha = this.alpha;
    pen.drawImage(this.image, x, y, x1 - x, y1 - y);
  }
}
