import { modeText, shortNumber, withArrows } from "./curves.js";
import { element, quantity } from "./elements.js";

// Numbers of the pose at the side, and on the sheet the compliance ellipse, the path by reach, and trails of a drag.
const NEAR_SINGULAR = 0.05; // ratio of singular values, as in seeing.py
const FADING = 1400; // time after which a trail is gone [ms]
const ELLIPSE = 64; // length of its larger semi-axis [px]
// Reach of the path by its number: word, colour of the sheet, dashes.
const REACHES = [["out of reach", "mark", [2, 6]], ["reached", "accent", []], ["near a singular position", "warn-line", [9, 5]]];

export class Seeing {
  constructor(bench) {
    Object.assign(this, { bench, sheet: bench.sheet, trails: new Map() });
    this.rows = new Map();
    this.list = element("dl", {});
    this.chips = withArrows(element("div", { class: "modes", role: "radiogroup", "aria-label": "Mode whose motors hold and drive" }));
    this.panel = element("details", { class: "numbers", open: true }, element("summary", {}, "This pose"), this.list, this.chips);
    bench.parts.side.prepend(this.panel);
    for (const what of ["state", "picture"]) bench.on(what, () => this.show());
    bench.on("picture", () => this.follow());
    this.sheet.under.push((pen) => this.paintUnder(pen));
    this.sheet.over.push((pen) => this.paintOver(pen));
  }

  show() {
    const { seen } = this.bench.state;
    // Quick numbers of a drag keep the chips, and all that takes longer, of the pose before.
    if (seen !== this.seen) [this.old, this.seen] = [!!seen && seen.chips === this.seen?.chips, seen];
    this.panel.hidden = !seen;
    if (!seen) return;
    const why = seen.why ?? {}, { old } = this;
    this.given = new Set();
    this.put("freedoms", "Degrees of freedom", freedomsText(seen, this.bench.state.picture?.joints.some((one) => one[4])), why.freedoms);
    this.put("condition", "Condition number", seen.condition === null || seen.condition === undefined ? "" : shortNumber(seen.condition, 3), seen.freedoms ? why.condition : "", false, "Largest by smallest effort in the task per torque of these motors; 1 is best");
    this.bars(seen);
    this.put("held", "Frequencies, held", frequencies(seen.held), why.held, old, "Lowest natural frequencies with the motors of this mode held");
    this.put("unheld", "Frequencies, free", frequencies(seen.unheld), why.unheld ?? why.held, old, "Lowest natural frequencies with free motors");
    this.put("compliance", "Compliance, held", seen.compliance ? `${quantity(seen.compliance.sizes[0], "m/N")}, ${quantity(seen.compliance.sizes[1], "m/N")}` : "", why.compliance ?? why.held, old, "Semi-axes of the ellipse: displacements of the end-effector by a force of 1 N with the motors of this mode held");
    this.put("loads", "Left out", "", why.loads, old);
    this.put("torques", "Holding torques", seen.torques ? Object.entries(seen.torques).map(([motor, value]) => `${motor} ${quantity(value, this.unitOf(motor)) || "–"}`).join(", ") || "no motors" : "", why.torques, false, "Torques of these motors that hold gravity, springs and loads");
    this.showChips(seen);
  }

  // Sliding joints take forces.
  unitOf(motor) { return this.bench.state.picture?.joints.find((one) => one[4] === motor)?.[1] === "prismatic" ? "N" : "N m"; }

  // A row; without a value the reason for it in grey, and no row without a reason or for one that was given before.
  put(key, label, text, why = "", old = false, help = "") {
    if (!this.rows.has(key)) {
      const term = element("dt", { title: help }, label), value = element("dd", { "data-number": key });
      this.list.append(term, value);
      this.rows.set(key, { term, value });
    }
    const { term, value } = this.rows.get(key), shown = text || (this.given.has(why) ? "" : why) || "";
    if (!text) this.given.add(why);
    term.hidden = value.hidden = !shown;
    if (value.textContent !== shown) value.textContent = shown;
    value.title = shown;
    value.className = text ? (old ? "old" : "") : "why";
  }

  // Distances from singular positions, as bars that are full far away from them.
  bars(seen) {
    const bars = [["reach", seen.serial, "of the end-effector (serial, type I)"], ["motors", seen.parallel, "of these motors (parallel, type II)"]].filter(([, value]) => value !== null && value !== undefined);
    this.put("singular", "From singular", bars.length ? "." : "", "");
    const { value } = this.rows.get("singular");
    value.replaceChildren(...bars.map(([word, share, help]) => {
      const fill = element("i", {}), text = `Distance from singular positions ${help}: ${shortNumber(share, 2)}; near below ${NEAR_SINGULAR}`;
      fill.style.width = `${Math.round(100 * Math.min(1, Math.sqrt(Math.max(share, 0))))}%`;
      return element("span", { class: "meter", role: "meter", "aria-valuemin": 0, "aria-valuemax": 1, "aria-valuenow": +share.toPrecision(3), "aria-label": text, title: text, "data-near": String(share < NEAR_SINGULAR) }, word, element("b", {}, fill));
    }));
  }

  showChips({ chips = [], mode }) {
    this.chips.hidden = !chips.length;
    const now = JSON.stringify([chips, mode]);
    if (now === this.chipsShown) return;
    this.chipsShown = now;
    const focused = this.chips.contains(document.activeElement) ? document.activeElement.textContent : null;
    this.chips.replaceChildren(...chips.map(({ name, motors, lacks, drives }) => {
      const text = lacks || `drives all ${drives} degree${drives === 1 ? "" : "s"} of freedom`;
      return element("button", { type: "button", role: "radio", "aria-checked": String(name === mode), title: `Motors ${motors.join(", ")}: ${text}`, "data-lacks": String(!!lacks), onclick: () => this.choose(name) }, element("b", {}, modeText(name)), element("small", {}, lacks || motors.join(" ")));
    }));
    [...this.chips.children].find((one) => one.textContent === focused)?.focus();
  }

  async choose(name) {
    const found = await this.bench.request("mode", { name });
    if (!found) return;
    Object.assign(this.bench.state, { mode: found.mode ?? name, seen: { ...this.bench.state.seen, ...found.seen, mode: name } });
    this.bench.notify("picture");
    this.bench.reach();
    this.bench.motion?.chooseMode(name);
  }

  // Trails of joints and the end-effector while the mechanism is dragged.
  follow() {
    const { picture } = this.bench.state;
    if (!this.bench.tools?.held?.sent || !picture) return;
    const now = performance.now(), places = picture.joints.map(([name, , x, y]) => [`joint ${name}`, x, y]), effector = picture.points.find(([ref]) => ref === picture.effector);
    if (effector) places.push(["effector", effector[1], effector[2]]);
    for (const [key, x, y] of places) {
      const trail = this.trails.get(key) ?? [], last = trail.at(-1);
      if (!last || Math.hypot(last[0] - x, last[1] - y) * this.sheet.scale > 1) trail.push([x, y, now]);
      this.trails.set(key, trail);
    }
  }

  get isPosed() { return !this.sheet.picture && !!this.bench.state.picture; }

  paintUnder(pen) {
    if (!this.isPosed) return;
    this.paintPath(pen);
    this.paintTrails(pen);
    if (this.bench.state.seen?.compliance) this.paintEllipse(pen, this.bench.state.seen.compliance);
  }

  paintTrails(pen) {
    const now = performance.now();
    let left = false;
    pen.lineCap = "butt"; pen.lineWidth = 2.4;
    for (const [key, trail] of this.trails) {
      while (trail.length && now - trail[0][2] > FADING) trail.shift();
      left ||= trail.length > 1;
      pen.strokeStyle = this.sheet.colour(key === "effector" ? "trail" : "soft");
      for (let k = 1; k < trail.length; k++) {
        pen.globalAlpha = 0.6 * (1 - (now - trail[k][2]) / FADING);
        pen.beginPath(); pen.moveTo(...this.sheet.px(...trail[k - 1])); pen.lineTo(...this.sheet.px(...trail[k])); pen.stroke();
      }
    }
    pen.globalAlpha = 1;
    if (left) this.sheet.repaint();
  }

  // Places of the path and their reach; until it is known again, that before.
  get path() { return (this.reached = this.bench.state.seen?.path ?? this.reached ?? []); }

  // The path in stretches of one reach each; a path that was not tried in grey.
  paintPath(pen) {
    const { path } = this;
    pen.lineCap = "butt"; pen.lineJoin = "round";
    if (!path.length) {
      const line = this.bench.state.picture.path ?? [];
      if (line.length) { pen.strokeStyle = this.sheet.colour("desired"); pen.lineWidth = 1.5; pen.setLineDash([6, 5]); this.sheet.trace(line); pen.stroke(); }
      return;
    }
    for (let from = 0, k = 1; k <= path.length; k++) {
      if (k < path.length && path[k][2] === path[from][2]) continue;
      const [, colour, dashes] = REACHES[path[from][2]];
      pen.strokeStyle = this.sheet.colour(colour); pen.lineWidth = path[from][2] === 1 ? 2 : 3; pen.setLineDash(dashes); pen.lineCap = path[from][2] ? "butt" : "round";
      this.sheet.trace(path.slice(from, k + 1)); pen.stroke();
      from = k;
    }
    pen.setLineDash([]);
  }

  paintOver(pen) {
    if (!this.isPosed) return;
    if (this.bench.state.seen?.compliance) this.paintSize(pen, this.bench.state.seen.compliance);
    this.paintLegend(pen);
  }

  paintLegend(pen) {
    const { path } = this;
    if (!path.length) return;
    const used = REACHES.map((one, reach) => [one, reach]).filter(([, reach]) => path.some((place) => place[2] === reach));
    pen.font = "12px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.textAlign = "right";
    let y = this.sheet.height - 16;
    for (const [[word, colour, dashes], reach] of used) {
      const x = this.sheet.width - 14;
      pen.fillStyle = this.sheet.colour("soft"); pen.fillText(`path ${word}`, x, y);
      const left = x - pen.measureText(`path ${word}`).width - 8;
      pen.strokeStyle = this.sheet.colour(colour); pen.lineWidth = reach === 1 ? 2 : 3; pen.setLineDash(dashes); pen.lineCap = reach ? "butt" : "round";
      pen.beginPath(); pen.moveTo(left - 30, y); pen.lineTo(left, y); pen.stroke(); pen.setLineDash([]);
      y -= 18;
    }
  }

  // The ellipse has a fixed size on the sheet; its larger semi-axis is written beside it.
  paintEllipse(pen, { sizes: [large, small], angle }) {
    const { picture } = this.bench.state, at = picture.points.find(([ref]) => ref === picture.effector);
    if (!at || !(large > 0)) return;
    const [px, py] = this.sheet.px(at[1], at[2]), b = Math.max((ELLIPSE * small) / large, 1), c = Math.cos(angle), s = Math.sin(angle);
    pen.globalAlpha = this.old ? 0.3 : 1;
    pen.strokeStyle = pen.fillStyle = this.sheet.colour("good"); pen.lineWidth = 1.6;
    pen.beginPath(); pen.ellipse(px, py, ELLIPSE, b, -angle, 0, 2 * Math.PI); pen.stroke();
    pen.globalAlpha *= 0.13; pen.fill(); pen.globalAlpha /= 0.13;
    pen.lineWidth = 1; pen.setLineDash([3, 3]);
    pen.beginPath(); pen.moveTo(px - ELLIPSE * c, py + ELLIPSE * s); pen.lineTo(px + ELLIPSE * c, py - ELLIPSE * s); pen.moveTo(px - b * s, py - b * c); pen.lineTo(px + b * s, py + b * c); pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  // Its larger semi-axis, written over the links.
  paintSize(pen, { sizes: [large], angle }) {
    const { picture } = this.bench.state, at = picture.points.find(([ref]) => ref === picture.effector);
    if (!at || !(large > 0) || this.old) return;
    const [px, py] = this.sheet.px(at[1], at[2]), c = Math.cos(angle), s = Math.sin(angle);
    const side = c < 0 ? -1 : 1, x = px + side * (ELLIPSE + 6) * c, y = py - side * (ELLIPSE + 6) * s;
    pen.font = "11.5px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.textAlign = Math.abs(c) > 0.3 ? "left" : "center"; pen.lineWidth = 4; pen.strokeStyle = this.sheet.colour("card"); pen.fillStyle = this.sheet.colour("good");
    const text = quantity(large, "m/N");
    pen.strokeText(text, x, y); pen.fillText(text, x, y);
  }
}

function freedomsText({ freedoms, drives }, motors) {
  if (freedoms === null || freedoms === undefined) return "";
  return drives === undefined || drives === freedoms || !motors ? `${freedoms}` : `${freedoms}, of which these motors drive ${drives}`;
}

function frequencies(values) { return values?.length ? `${values.map((one) => shortNumber(one, 3)).join(", ")} Hz` : ""; }
