import { element } from "./elements.js";

// Charts as Python describes them for reports, on canvas: axes with units, curves, a legend with the values at the time.
// The functions seriesRows and between are those of the reports, in unpacking.js.
const CURVE_DASHES = [[], [6, 4], [1.5, 3], [7, 3, 1.5, 3], [11, 4]];
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const FONT = "11.5px system-ui, sans-serif";
const MOST_DECADES = 5;

// The numbers of a page of Python, with its rows unpacked.
export async function readPage(page) {
  return { ...page, rows: page.series ? await seriesRows(page.series) : [] };
}

// A short text of a number, with a true minus and powers of ten.
export function shortNumber(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size && (size >= 1e5 || size < 1e-3)) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e"), exponent = [...power.replace(/^\+/, "")].map((c) => SUPERSCRIPTS[c] ?? "⁻").join("");
    return `${+mantissa === 1 ? "" : `${+mantissa}·`}10${exponent}`.replace("-", "−");
  }
  return String(+value.toPrecision(digits)).replace("-", "−");
}

// Name of a mode with a true minus.
export function modeText(name) { return /^[+-]+$/.test(name) ? name.replaceAll("-", "−") : name; }

// Arrows go through the buttons of a group and press them, as through radio buttons.
export function withArrows(group) {
  group.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key], count = group.children.length, k = [...group.children].indexOf(event.target);
    if (!by || k < 0) return;
    event.preventDefault();
    group.children[(k + by + count) % count].click();
    group.children[(k + by + count) % count]?.focus();
  });
  return group;
}

// Round numbers within a range, about as many as asked for.
export function roundTicks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((one) => one * power >= rough * 0.7), out = [];
  for (let k = Math.ceil(low / step - 1e-9); k <= high / step + 1e-9; k++) out.push(+(k * step).toPrecision(12));
  return out;
}

// Numbers of a logarithmic axis: powers of ten, between them two and five where there is room.
function logTicks(low, high, count) {
  const out = [], digits = high - low < 2.2 ? [1, 2, 5] : [1], every = Math.max(1, Math.ceil((high - low) / Math.max(count, 1)));
  for (let power = Math.floor(low); power <= high; power++) {
    if (digits.length === 1 && power % every) continue;
    for (const digit of digits) { const at = power + Math.log10(digit); if (at >= low - 1e-9 && at <= high + 1e-9) out.push(at); }
  }
  return out;
}

// One direction of a chart: from values to pixels, and its numbers.
class Scale {
  constructor(log, fixed = null) { Object.assign(this, { log, fixed, low: Infinity, high: -Infinity }); }

  of(value) { return this.log ? Math.log10(value) : value; }

  take(values) {
    for (const value of values) {
      const at = this.of(value);
      if (!Number.isFinite(at)) continue;
      if (at < this.low) this.low = at;
      if (at > this.high) this.high = at;
    }
  }

  // Ends of the range; rounding of what is constant is not drawn as a curve.
  close(room) {
    if (this.fixed) [this.low, this.high] = this.fixed;
    if (!(this.high >= this.low)) [this.low, this.high] = [0, 1];
    if (this.log) this.low = Math.max(this.low, this.high - MOST_DECADES);
    const size = Math.max(Math.abs(this.low), Math.abs(this.high), 1e-300);
    if (this.high - this.low < 1e-6 * size || this.high === this.low) { const half = this.log ? 0.5 : size > 1e-290 ? 0.1 * size : 1; [this.low, this.high] = [this.low - half, this.high + half]; }
    if (!this.fixed) { const more = room * (this.high - this.low); this.low -= more; this.high += more; }
  }

  lay(from, to) { this.from = from; this.slope = (to - from) / (this.high - this.low); }
  px(value) { return this.from + this.slope * (this.of(value) - this.low); }
  back(px) { const at = this.low + (px - this.from) / this.slope; return this.log ? 10 ** at : at; }
  ticks(count) { return this.log ? logTicks(this.low, this.high, count).map((at) => 10 ** at) : roundTicks(this.low, this.high, count); }
}

// A chart; `clock` has the time, the index of the run, the abscissa `over` (0 for the time) and seek(time).
export class Chart {
  constructor(bench, clock, description, page) {
    Object.assign(this, { bench, clock, description, page, before: null, choice: 0, hidden: new Set(), hover: null });
    this.paper = element("canvas", { role: "img", "aria-label": `${description.title}: ${[description.y].flat()[0]} over ${description.x}` });
    this.front = element("canvas", { class: "front", "aria-hidden": "true" });
    this.tip = element("div", { class: "tip", hidden: true });
    this.holder = element("div", { class: `plot${description.equal ? " square" : ""}` }, this.paper, this.front, this.tip);
    this.legend = element("div", { class: "legend", role: "group", "aria-label": `Curves of ${description.title}` });
    const head = element("header", {}, element("h3", {}, description.title));
    if (description.choices.length) head.append(this.chooser());
    this.figure = element("figure", { class: "chart" }, head, this.holder, this.legend);
    if (description.note) this.figure.append(element("figcaption", {}, description.note));
    this.front.addEventListener("pointermove", (event) => this.pointed(event));
    this.front.addEventListener("pointerdown", (event) => { this.front.setPointerCapture(event.pointerId); this.pressed = true; this.pointed(event); });
    this.front.addEventListener("pointerup", () => { this.pressed = false; });
    this.front.addEventListener("pointerleave", () => { this.hover = null; this.paintFront(); });
    new ResizeObserver(() => this.paint()).observe(this.holder);
  }

  chooser() {
    const select = element("select", { "aria-label": `${this.description.title}: ${this.description.choosing}`, onchange: () => { this.choice = Number(select.value); this.paint(); } });
    this.description.choices.forEach((name, k) => select.append(element("option", { value: k }, name)));
    return select;
  }

  // Another run of the same chart; the one before it is drawn in grey.
  renew(description, page, before) { Object.assign(this, { description, page, before }); this.paint(); }

  isOverTime() { return this.description.over_time && !this.clock.over; }
  isShown(curve, run = this.clock.index) { return (curve.shown === null || curve.shown.includes(run)) && (curve.choice === null || curve.choice === this.choice); }
  get label() { const { y } = this.description; return Array.isArray(y) ? y[y.length > 1 ? this.choice : 0] : y; }
  get over() { return this.description.over_time && this.clock.over ? this.page.abscissae[this.clock.over - 1] : null; }

  // Abscissae of a curve: its own, or those over which the reader sees it.
  xs(curve, page, run) {
    const own = page.rows[curve.x], times = page.rows[page.time], over = this.description.over_time && this.clock.over ? page.abscissae[this.clock.over - 1] : null;
    if (!over) return own;
    const values = page.rows[over.rows[curve.run ?? run] ?? over.rows[0]];
    return own === times ? values : Float64Array.from(own, (time) => sampleAt(values, between(times, time)));
  }

  // Curves to draw: those of the run, after them in grey those of the run before.
  drawn() {
    const shown = this.description.curves.filter((curve) => curve.mark !== "bar" && this.isShown(curve) && !this.hidden.has(curve.name));
    const beside = new Set(shown.map((curve) => curve.run).filter((run) => run !== null)).size > 1;
    const own = shown.map((curve) => ({ curve, x: this.xs(curve, this.page, this.clock.index), y: this.page.rows[curve.y], strong: beside && curve.run === this.clock.index, weak: beside && curve.run !== this.clock.index }));
    return [...this.drawnBefore(), ...own];
  }

  drawnBefore() {
    if (!this.before) return [];
    const { description, page } = this.before, run = page.runs.indexOf(this.page.runs[this.clock.index]);
    if (run < 0) return [];
    return description.curves.filter((curve) => !curve.mark && !curve.desired && this.isShown(curve, run) && (curve.run ?? run) === run && !this.hidden.has(curve.name))
      .map((curve) => ({ curve, x: this.xs(curve, page, run), y: page.rows[curve.y], ghost: true }));
  }

  colour(curve) { return curve.colour === null ? this.bench.colours.of("text") : this.bench.colours.link(curve.colour); }

  // The canvas in pixels of the screen; null while it is not seen.
  pen(canvas) {
    const ratio = devicePixelRatio || 1, [wide, high] = [this.holder.clientWidth, this.holder.clientHeight];
    if (!wide || !high) return null;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio)) { canvas.width = Math.round(wide * ratio); canvas.height = Math.round(high * ratio); }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, high);
    return Object.assign(pen, { wide, high });
  }

  paint() {
    const pen = this.pen(this.paper);
    if (!pen) return;
    this.curves = this.drawn();
    this.layOut(pen);
    this.paintAxes(pen);
    pen.save();
    pen.beginPath(); pen.rect(this.left, this.top - 1, this.right - this.left, this.bottom - this.top + 2); pen.clip();
    for (const one of this.curves) this.paintCurve(pen, one);
    pen.restore();
    this.fillLegend();
    this.paintFront();
  }

  layOut(pen) {
    const { log, log_x: logX, equal, layout } = this.description, times = this.page.rows[this.page.time];
    const fixed = (axis) => (layout?.[axis]?.range && !layout[axis].range.some((one) => !Number.isFinite(one)) ? layout[axis].range : null);
    this.x = new Scale(!!logX && !this.over, this.isOverTime() && times?.length > 1 ? [times[0], times.at(-1)] : fixed("xaxis"));
    this.y = new Scale(!!log, fixed("yaxis"));
    for (const { x, y } of this.curves) { this.x.take(x); this.y.take(y); }
    this.x.close(this.isOverTime() ? 0 : 0.03);
    this.y.close(0.06);
    [this.top, this.bottom, this.right] = [20, pen.high - 32, pen.wide - 10];
    pen.font = FONT;
    const rows = Math.max(2, Math.floor((this.bottom - this.top) / 26));
    this.yTicks = layout?.yaxis?.tickvals ?? this.y.ticks(rows);
    this.yTexts = layout?.yaxis?.ticktext ?? this.yTicks.map((at) => shortNumber(at, 5));
    this.left = 12 + Math.max(16, ...this.yTexts.map((text) => pen.measureText(text).width));
    if (equal) this.equalise();
    this.x.lay(this.left, this.right);
    this.y.lay(this.bottom, this.top);
    this.xTicks = layout?.xaxis?.tickvals ?? this.x.ticks(Math.max(2, Math.floor((this.right - this.left) / 62)));
    this.xTexts = layout?.xaxis?.ticktext ?? this.xTicks.map((at) => shortNumber(at, 5));
    if (equal) { this.yTicks = this.y.ticks(rows); this.yTexts = this.yTicks.map((at) => shortNumber(at, 5)); }
  }

  // The same scale both ways.
  equalise() {
    const unit = Math.max((this.x.high - this.x.low) / (this.right - this.left), (this.y.high - this.y.low) / (this.bottom - this.top));
    for (const [scale, long] of [[this.x, this.right - this.left], [this.y, this.bottom - this.top]]) {
      const middle = (scale.low + scale.high) / 2;
      [scale.low, scale.high] = [middle - unit * long / 2, middle + unit * long / 2];
    }
  }

  paintAxes(pen) {
    const { colours } = this.bench, crisp = (value) => Math.round(value) + 0.5;
    pen.font = FONT; pen.lineWidth = 1; pen.textBaseline = "middle"; pen.textAlign = "right";
    this.paintShapes(pen);
    this.yTicks.forEach((at, k) => {
      const y = crisp(this.y.px(at));
      if (y < this.top - 2 || y > this.bottom + 2) return;
      pen.strokeStyle = colours.of("grid"); pen.beginPath(); pen.moveTo(this.left, y); pen.lineTo(this.right, y); pen.stroke();
      pen.fillStyle = colours.of("soft"); pen.fillText(this.yTexts[k], this.left - 6, y);
    });
    pen.textAlign = "center"; pen.textBaseline = "top";
    let free = -Infinity;
    this.xTicks.forEach((at, k) => {
      const x = crisp(this.x.px(at)), half = pen.measureText(this.xTexts[k]).width / 2;
      if (x < this.left - 1 || x > this.right + 1) return;
      pen.strokeStyle = colours.of("grid"); pen.beginPath(); pen.moveTo(x, this.top); pen.lineTo(x, this.bottom); pen.stroke();
      if (x - half < free) return;
      free = x + half + 6;
      pen.fillStyle = colours.of("soft"); pen.fillText(this.xTexts[k], Math.min(x, pen.wide - half - 1), this.bottom + 5);
    });
    pen.strokeStyle = colours.of("soft");
    pen.beginPath(); pen.moveTo(crisp(this.left), this.top); pen.lineTo(crisp(this.left), crisp(this.bottom)); pen.lineTo(this.right, crisp(this.bottom)); pen.stroke();
    pen.fillStyle = colours.of("text"); pen.textAlign = "left"; pen.textBaseline = "top"; pen.fillText(this.label, 2, 2);
    pen.textAlign = "right"; pen.textBaseline = "bottom"; pen.fillText(this.over?.label ?? this.description.x, this.right, pen.high - 1);
  }

  // Shaded ranges of the abscissa, and lines at levels.
  paintShapes(pen) {
    const { colours } = this.bench;
    for (const shape of this.description.layout?.shapes ?? []) {
      if (shape.type === "rect" && !this.over) { pen.fillStyle = "rgba(128,128,128,0.14)"; pen.fillRect(this.x.px(shape.x0), this.top, this.x.px(shape.x1) - this.x.px(shape.x0), this.bottom - this.top); }
      if (shape.type !== "line") continue;
      const y = this.y.px(shape.y0);
      pen.strokeStyle = colours.of("soft"); pen.setLineDash([5, 4]); pen.beginPath(); pen.moveTo(this.left, y); pen.lineTo(this.right, y); pen.stroke(); pen.setLineDash([]);
    }
  }

  paintCurve(pen, { curve, x, y, strong, weak, ghost }) {
    const { colours } = this.bench;
    pen.strokeStyle = pen.fillStyle = ghost ? colours.of("soft") : this.colour(curve);
    pen.globalAlpha = ghost ? 0.75 : weak ? 0.65 : curve.faint ? 0.5 : 1;
    pen.lineWidth = ghost ? 1.3 : strong ? 2.4 : weak ? 1.2 : 1.7;
    pen.lineJoin = "round"; pen.setLineDash(ghost ? [4, 3] : CURVE_DASHES[curve.dash ?? 0] ?? []);
    if (!curve.mark || curve.line) this.paintLine(pen, x, y);
    pen.setLineDash([]);
    if (curve.mark) for (let k = 0; k < y.length; k++) paintMark(pen, curve.mark, this.x.px(x[k]), this.y.px(y[k]), (curve.faint ? 3 : 4) * (curve.size ?? 1));
    pen.globalAlpha = 1;
  }

  paintLine(pen, x, y) {
    let begun = false;
    pen.beginPath();
    for (let k = 0; k < y.length; k++) {
      const px = this.x.px(x[k]), py = this.y.px(y[k]);
      if (!Number.isFinite(px) || !Number.isFinite(py)) { begun = false; continue; }
      if (begun) pen.lineTo(px, py); else pen.moveTo(px, py);
      begun = true;
    }
    pen.stroke();
  }

  // Cursor at the time and dots on the curves; what the pointer is at.
  paintFront() {
    const pen = this.x && this.pen(this.front);
    if (!pen) return;
    const { colours } = this.bench, overTime = this.isOverTime(), { time } = this.clock;
    if (overTime) { pen.strokeStyle = colours.of("accent"); pen.lineWidth = 1.4; this.upright(pen, this.x.px(time)); }
    for (const one of this.curves) {
      if (one.ghost || one.curve.mark || one.weak) continue;
      const place = this.place(one);
      if (!place) continue;
      const [px, py] = [this.x.px(sampleAt(one.x, place)), this.y.px(sampleAt(one.y, place))];
      if (!Number.isFinite(py) || py < this.top - 2 || py > this.bottom + 2) continue;
      pen.fillStyle = this.colour(one.curve); pen.strokeStyle = colours.of("card"); pen.lineWidth = 1.2;
      pen.beginPath(); pen.arc(px, py, 3.4, 0, 7); pen.fill(); pen.stroke();
    }
    this.showValues();
    this.paintHover(pen);
  }

  upright(pen, px) { pen.beginPath(); pen.moveTo(px, this.top); pen.lineTo(px, this.bottom); pen.stroke(); }

  // The place among the samples of a curve at the time; null for curves that are not of the time.
  place({ curve }, page = this.page) {
    const times = page.rows[page.time];
    if (this.description.over_time) return between(page.rows[curve.x], this.clock.time);
    return times?.length > 1 && page.rows[curve.y].length === times.length && curve.run !== null ? between(times, this.clock.time) : null;
  }

  fillLegend() {
    const names = new Map();
    for (const curve of this.description.curves) if (curve.name && this.isShown(curve) && !names.has(curve.name)) names.set(curve.name, curve);
    this.values = new Map();
    this.legend.replaceChildren(...[...names].map(([name, curve]) => this.entry(name, curve)));
    if (this.before && this.drawnBefore().length) this.legend.append(element("span", { class: "ghost" }, "┄ before"));
  }

  entry(name, curve) {
    const sample = element("canvas", { width: 44, height: 20, class: "sample", "aria-hidden": "true" }), pen = sample.getContext("2d"), value = element("output", {});
    pen.scale(2, 2);
    pen.strokeStyle = pen.fillStyle = this.colour(curve); pen.lineWidth = 2; pen.setLineDash(CURVE_DASHES[curve.dash ?? 0] ?? []);
    if (!curve.mark || curve.line) { pen.beginPath(); pen.moveTo(0, 5); pen.lineTo(22, 5); pen.stroke(); }
    pen.setLineDash([]);
    if (curve.mark) paintMark(pen, curve.mark, 11, 5, 4);
    this.values.set(name, value);
    return element("button", { type: "button", title: "Show or hide", "aria-pressed": String(!this.hidden.has(name)), onclick: () => {
      if (!this.hidden.delete(name)) this.hidden.add(name);
      this.paint();
    } }, sample, element("span", {}, name), value);
  }

  showValues() {
    const seen = new Set();
    for (const one of this.curves) {
      const output = one.ghost || one.curve.mark || seen.has(one.curve.name) ? null : this.values.get(one.curve.name), place = output && this.place(one);
      if (!place) continue;
      seen.add(one.curve.name);
      const text = shortNumber(sampleAt(one.y, place));
      if (output.textContent !== text) output.textContent = text;
    }
  }

  pointed(event) {
    const box = this.front.getBoundingClientRect();
    this.hover = [event.clientX - box.left, event.clientY - box.top];
    if (this.pressed && this.isOverTime() && this.x) this.clock.seek(this.x.back(this.hover[0]));
    this.paintFront();
  }

  // Values under the pointer: of all curves at its abscissa over time, else the nearest point.
  paintHover(pen) {
    this.tip.hidden = true;
    if (!this.hover || this.hover[0] < this.left || this.hover[0] > this.right || this.hover[1] < this.top || this.hover[1] > this.bottom) return;
    const rows = this.isOverTime() ? this.rowsAt(pen, this.hover[0]) : this.nearest(pen);
    if (!rows.length) return;
    this.tip.hidden = false;
    this.tip.replaceChildren(...rows.map(([text, value]) => element("div", {}, element("span", {}, text), element("b", {}, value))));
    const [x, y] = this.hover, wide = this.tip.offsetWidth, right = x + 14 + wide < pen.wide;
    this.tip.style.transform = `translate(${right ? x + 12 : Math.max(0, x - wide - 12)}px, ${Math.max(0, Math.min(y - 20, pen.high - this.tip.offsetHeight - 4))}px)`;
  }

  rowsAt(pen, px) {
    const at = this.x.back(px);
    pen.strokeStyle = this.bench.colours.of("soft"); pen.lineWidth = 1; pen.setLineDash([2, 3]); this.upright(pen, px); pen.setLineDash([]);
    const rows = this.curves.filter(({ curve }) => !curve.quiet && !curve.mark && curve.name).slice(0, 12).map(({ curve, x, y, ghost }) => [ghost ? `${curve.name} before` : curve.name, shortNumber(sampleAt(y, between(x, at)))]);
    return rows.length ? [[this.description.x, shortNumber(at)], ...rows] : [];
  }

  nearest(pen) {
    let best = null, least = 24;
    for (const one of this.curves) {
      for (let k = 0; k < one.y.length; k++) {
        const far = Math.hypot(this.x.px(one.x[k]) - this.hover[0], this.y.px(one.y[k]) - this.hover[1]);
        if (far < least) { least = far; best = [one, k]; }
      }
    }
    if (!best) return [];
    const [{ curve, x, y }, k] = best;
    pen.strokeStyle = this.colour(curve); pen.lineWidth = 1.6; pen.beginPath(); pen.arc(this.x.px(x[k]), this.y.px(y[k]), 6, 0, 7); pen.stroke();
    const text = curve.texts?.[k];
    return text ? [[curve.name, text]] : [[this.over?.label ?? this.description.x, shortNumber(x[k])], [curve.name || this.label, shortNumber(y[k])]];
  }
}

function sampleAt(row, [before, share]) { return row[before] + (share ? share * (row[before + 1] - row[before]) : 0); }

function paintMark(pen, kind, x, y, size) {
  if (!Number.isFinite(x) || !Number.isFinite(y)) return;
  pen.lineWidth = 1.6;
  pen.beginPath();
  if (kind === "cross") { pen.moveTo(x - size, y - size); pen.lineTo(x + size, y + size); pen.moveTo(x - size, y + size); pen.lineTo(x + size, y - size); } else if (kind === "square") pen.rect(x - size, y - size, 2 * size, 2 * size);
  else if (kind === "triangle" || kind === "diamond") {
    pen.moveTo(x, y - size); pen.lineTo(x + size, kind === "diamond" ? y : y + size);
    if (kind === "diamond") pen.lineTo(x, y + size);
    pen.lineTo(x - size, kind === "diamond" ? y : y + size); pen.closePath();
  } else pen.arc(x, y, size, 0, 7);
  if (kind === "square" || kind === "dot") pen.fill(); else pen.stroke();
}
