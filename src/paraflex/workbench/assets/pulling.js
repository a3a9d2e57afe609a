import { Chart, shortNumber } from "./curves.js";
import { Newest } from "./dragging.js";
import { button, element, quantity } from "./elements.js";

// Statics: a force that a person pulls from a point, and the linear model of a pose.
const PULL_FORCES = [0.01, 0.1, 1, 10, 100, 1000]; // force of a pull of 100 px [N]
const PULL_SHOWN = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
const SEEN_BENDING = 28; // deflection on the sheet up to which it is magnified [px]

export class Pulling {
  constructor(bench) {
    Object.assign(this, { bench, sheet: bench.sheet, on: false, ref: null, force: [0, 0], found: null });
    bench.pull = this;
    this.newest = new Newest(bench, "force", (found) => this.take(found));
    this.size = element("select", { "aria-label": "Force of a pull of 100 pixels" }, ...PULL_FORCES.map((one) => element("option", { value: one }, quantity(one, "N"))));
    this.size.value = 10;
    this.text = element("span", { class: "found" });
    this.panel = element("div", { class: "pulling", hidden: true }, element("div", {}, element("label", {}, "100 px pull ", this.size), button("×", "End pulling (Escape)", () => this.switch(false), { class: "icon small" })), this.text);
    bench.parts.stage.append(this.panel);
    this.opener = button("⤳ Pull", "Pull at a point with a force: deflection, stiffness and buckling load", () => this.switch(!this.on), { "aria-pressed": "false" });
    const { canvas } = this.sheet;
    for (const [kind, act] of [["pointerdown", "down"], ["pointermove", "moved"], ["pointerup", "up"]]) canvas.addEventListener(kind, (event) => this.caught(event, act), { capture: true });
    canvas.addEventListener("keydown", (event) => { if (this.on && event.key === "Escape") { this.switch(false); event.stopPropagation(); } });
    bench.on("state", () => this.clear());
    this.sheet.over.push((pen) => this.paint(pen));
  }

  switch(on) {
    this.on = on;
    this.opener.setAttribute("aria-pressed", on);
    this.panel.hidden = !on;
    if (on) { this.bench.motion.stop(); this.bench.tools.choose("select"); this.sheet.canvas.focus(); this.text.textContent = "Press at a point of a link and pull."; }
    this.clear();
  }

  clear() {
    this.ref = this.found = null;
    if (this.pulled) { this.sheet.picture = null; this.pulled = false; }
    this.sheet.repaint();
  }

  // Presses of the first button are pulls while this is on.
  caught(event, act) {
    if (!this.on || (act === "down" ? event.button !== 0 || this.bench.tools.spaceHeld : !this.ref || !this.held)) return;
    event.stopImmediatePropagation();
    const box = this.sheet.canvas.getBoundingClientRect();
    this[act]([event.clientX - box.left, event.clientY - box.top], event);
  }

  down([px, py], event) {
    this.clear();
    const near = (this.bench.state.picture?.points ?? []).filter(([ref]) => !ref.startsWith("ground.")).map(([ref, x, y]) => [ref, [x, y], Math.hypot(...[0, 1].map((axis) => this.sheet.px(x, y)[axis] - [px, py][axis]))]).sort((a, b) => a[2] - b[2])[0];
    if (!near || near[2] > 18) { this.text.textContent = "There is no point of a link: press at one and pull; Further point (O) adds one."; return; }
    this.sheet.canvas.setPointerCapture(event.pointerId);
    this.held = true;
    this.begin(near[0], near[1]);
  }

  moved([px, py]) {
    this.bench.tools.under = null;
    const [ax, ay] = this.sheet.px(...this.at), scale = Number(this.size.value) / 100;
    this.move([scale * (px - ax), scale * (ay - py)]);
  }

  up() { this.held = false; this.end(); }

  begin(ref, at = null) {
    this.ref = ref;
    this.at = at ?? this.bench.state.picture.points.find(([one]) => one === ref).slice(1);
    this.force = [0, 0];
  }

  // The load at which it buckles takes longest, and is computed when the pull rests.
  move(force, buckling = false) {
    this.force = force;
    this.newest.send({ ref: this.ref, force, buckling });
    this.sheet.repaint();
  }

  end() { if (Math.hypot(...this.force)) this.move(this.force, true); }

  take(found) {
    if (!this.ref || !found.bodies) return;
    this.found = found;
    this.pulled = true;
    this.sheet.picture = this.bent(found);
    this.sheet.repaint();
    const [dx, dy] = found.deflection, size = Math.hypot(...this.force), lines = [
      `${this.ref} moves by ${quantity(dx, "m") || "0"}, ${quantity(dy, "m") || "0"}`, found.stiffness ? `stiffness along the force ${quantity(found.stiffness, "N/m")}` : "",
      found.buckling ? `buckles at ${quantity(found.buckling * size, "N")}, ${shortNumber(found.buckling, 3)} times this force (${found.buckling_note})` : "", ...found.findings, this.shown > 1 ? `drawn × ${this.shown}` : "",
    ].filter(Boolean);
    this.text.replaceChildren(...lines.map((line) => element("div", { class: found.findings.includes(line) ? "wrong" : "" }, line)));
  }

  // The picture with links at base + m (bent - base); symbols go with the station that is nearest to them.
  bent(found) {
    const { picture } = this.bench.state, moves = found.bodies.flatMap(([, bent], body) => found.base[body].map((place, k) => [place, [bent[k][0] - place[0], bent[k][1] - place[1]]]));
    const most = Math.max(...moves.map(([, by]) => Math.hypot(...by))) * this.sheet.scale;
    this.shown = PULL_SHOWN.findLast((one) => one * most <= SEEN_BENDING) ?? 1;
    const by = (x, y) => {
      const [, [dx, dy]] = moves.reduce((best, one) => (Math.hypot(one[0][0] - x, one[0][1] - y) < Math.hypot(best[0][0] - x, best[0][1] - y) ? one : best));
      return [this.shown * dx, this.shown * dy];
    };
    const shifted = (points) => { const known = points.filter(Boolean), [dx, dy] = by(...[0, 1].map((axis) => known.reduce((sum, one) => sum + one[axis], 0) / known.length)); return points.map((one) => one && [one[0] + dx, one[1] + dy]); };
    return {
      ...picture, bodies: found.bodies.map(([name, bent, plate], body) => [name, found.base[body].map((place, k) => place.map((one, axis) => one + this.shown * (bent[k][axis] - one))), plate]),
      marks: picture.marks.map(([when, look, name, points]) => [when, look, name, when === "still" ? points : shifted(points)]),
      joints: picture.joints.map(([name, kind, x, y, ...rest]) => { const [dx, dy] = by(x, y); return [name, kind, x + dx, y + dy, ...rest]; }),
      points: picture.points.map(([ref, x, y]) => { const [dx, dy] = ref.startsWith("ground.") ? [0, 0] : by(x, y); return [ref, x + dx, y + dy]; }),
    };
  }

  paint(pen) {
    if (!this.on || !this.ref) return;
    const [, x, y] = (this.sheet.shown?.points ?? []).find(([ref]) => ref === this.ref) ?? [], size = Math.hypot(...this.force);
    if (x === undefined || !size) return;
    const scale = 100 / Number(this.size.value), [ax, ay] = this.sheet.px(x, y), [bx, by] = [ax + scale * this.force[0], ay - scale * this.force[1]], angle = Math.atan2(by - ay, bx - ax);
    pen.strokeStyle = pen.fillStyle = this.sheet.colour("trail"); pen.lineWidth = 2.6;
    pen.beginPath(); pen.moveTo(ax, ay); pen.lineTo(bx, by); pen.stroke();
    pen.beginPath(); pen.moveTo(bx + 4 * Math.cos(angle), by + 4 * Math.sin(angle));
    for (const side of [2.6, -2.6]) pen.lineTo(bx + 11 * Math.cos(angle + side), by + 11 * Math.sin(angle + side));
    pen.closePath(); pen.fill();
    pen.font = "600 12.5px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.textAlign = Math.cos(angle) < 0 ? "right" : "left"; pen.lineWidth = 4; pen.strokeStyle = this.sheet.colour("card");
    const text = quantity(size, "N"), at = [bx + 14 * Math.cos(angle), by + 16 * Math.sin(angle)];
    pen.strokeText(text, ...at); pen.fillText(text, ...at);
  }
}

// Charts and the table of a linear model: poles, and the response from a motor to the end-effector.
export function linearCharts(bench, found) {
  const rows = [], row = (values) => rows.push(Float64Array.from(values, (value) => value ?? NaN)) - 1, plain = { run: null, shown: null, choice: null, dash: 0 };
  const base = { choices: [], choosing: "", log: false, log_x: false, equal: false, over_time: false, note: "", layout: {} }, charts = [];
  const texts = found.poles.map(([re, im]) => `${shortNumber(re)} ± ${shortNumber(im)} i`), both = (part) => row([...found.poles.map(part), ...found.poles.map(part)]);
  const whole = found.poles.map(([, im]) => im);
  charts.push({ ...base, identity: "poles", title: "Poles", x: "real part [1/s]", y: ["imaginary part [rad/s]"], curves: [{ ...plain, name: "poles", mark: "cross", texts: [...texts, ...texts], colour: 0, x: both(([re]) => re), y: row([...whole, ...whole.map((im) => -im)]) }] });
  if (found.responses.length) {
    const at = row(found.frequency), curves = (key) => found.responses.map((one, k) => ({ ...plain, name: one.output, colour: k % 8, dash: [0, 1, 3][k % 3], x: at, y: row(one[key]) })), units = [...new Set(found.responses.map((one) => one.unit))];
    charts.push({ ...base, identity: "magnitude", title: `Response to ${found.input}`, x: "frequency [Hz]", y: [`magnitude [dB of ${units.join(", ")}]`], log_x: true, curves: curves("magnitude") });
    charts.push({ ...base, identity: "phase", title: "Phase", x: "frequency [Hz]", y: ["phase [°]"], log_x: true, curves: curves("phase") });
  }
  const page = { rows, runs: [""], abscissae: [], time: -1 }, clock = { time: 0, index: 0, over: 0, seek() {} };
  const note = [found.held.length ? `Frequencies with these motors held: ${found.held.map((one) => shortNumber(one, 3)).join(", ")} Hz.` : "", found.unbalanced > 1e-6 ? `The mechanism does not rest here: it would start with ${quantity(found.unbalanced, "m/s^2")}.` : ""].filter(Boolean).join(" ");
  const table = { title: "Poles", heads: [["real part", "1/s"], ["imaginary part", "rad/s"], ["frequency", "Hz"], ["damping ratio", ""]], rows: found.poles.slice(0, 12).map((pole) => pole.map((one) => shortNumber(one ?? NaN))), note };
  return { charts: charts.map((one) => new Chart(bench, clock, one, page)), table };
}
