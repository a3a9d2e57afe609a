import { element } from "./elements.js";
import { alongLine, placeNames } from "./names.js";
import { Places } from "./places.js";

// The sheet: a canvas with the mechanism in metres, moved and scaled by the person, and layers that others paint over it.
const LEAST = 1e-5, MOST = 1e4; // width of the view [m]
const ACTING = ["load", "spring", "sensor"]; // looks of symbols that have names
const NEAR = 11; // distance at which something is hit [px]

export class Sheet {
  constructor(bench) {
    this.bench = bench;
    this.canvas = element("canvas", { class: "sheet", tabindex: "0", role: "application", "aria-label": "Sheet with the mechanism" });
    this.pen = this.canvas.getContext("2d");
    this.centre = [0, 0.15];
    this.scale = 1200; // px/m
    this.places = new Places(this);
    this.stands = new Map();
    this.behind = []; // functions (pen, sheet) that paint below the grid, below the mechanism, and above it
    this.under = [];
    this.over = [];
    this.picture = null; // a picture that stands in for that of the state, as while a run is played
    this.frames = 0;
    this.grid = true;
    this.names = true;
    this.waiting = false;
    new ResizeObserver(() => this.resized()).observe(this.canvas);
    this.canvas.addEventListener("wheel", (event) => this.wheeled(event), { passive: false });
    bench.colours.listeners.push(() => this.repaint());
  }

  get shown() { return this.picture ?? this.bench.state.picture; }
  px(x, y) { return [this.width / 2 + this.scale * (x - this.centre[0]), this.height / 2 - this.scale * (y - this.centre[1])]; }
  metres(px, py) { return [this.centre[0] + (px - this.width / 2) / this.scale, this.centre[1] - (py - this.height / 2) / this.scale]; }
  get limits() {
    const [left, top] = this.metres(0, 0), [right, bottom] = this.metres(this.width, this.height);
    return [left, bottom, right, top];
  }

  // The grid's step in metres: 1, 2 or 5 of a power of ten, at least 14 px.
  get step() {
    const least = 14 / this.scale, power = 10 ** Math.floor(Math.log10(least));
    return power * [1, 2, 5, 10].find((one) => one * power >= least * 0.999);
  }

  resized() {
    const ratio = devicePixelRatio || 1;
    [this.width, this.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!this.width) return;
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (this.fitting) this.fit(); else this.seen();
  }

  // Show all of the mechanism.
  fit() {
    const { shown } = this, limits = shown?.limits ?? [-0.25, -0.1, 0.25, 0.3], path = (shown?.path ?? []).filter(Boolean);
    this.fitting = true;
    if (!this.width) return;
    this.show(limits.map((one, k) => (k < 2 ? Math.min : Math.max)(one, ...path.map((place) => place[k % 2]))), true);
  }

  // Show a part of the plane.
  show([x0, y0, x1, y1], fitting = false) {
    this.fitting = fitting;
    this.scale = 0.86 * Math.min(this.width / (x1 - x0), (this.height - 60) / (y1 - y0));
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2];
    this.seen();
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.metres(px, py), wide = this.width / (this.scale * factor);
    if (wide < LEAST || wide > MOST) return;
    this.scale *= factor;
    const [nx, ny] = this.metres(px, py);
    this.move(x - nx, y - ny);
  }

  move(dx, dy) {
    this.fitting = false;
    this.centre = [this.centre[0] + dx, this.centre[1] + dy];
    this.seen();
  }

  wheeled(event) {
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), event.clientX - box.left, event.clientY - box.top);
  }

  // Python sizes symbols by what is seen; asked for once the view has come to rest.
  seen() {
    this.repaint();
    clearTimeout(this.asking);
    this.asking = setTimeout(async () => {
      const { revision } = this.bench.state, found = await this.bench.link.ask("view", { limits: this.limits }).catch(() => null);
      if (found && revision === this.bench.state.revision) this.bench.state.picture = found.picture;
      this.repaint();
    }, 60);
  }

  repaint() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.paint(); });
  }

  paint() {
    if (!this.width) return;
    const { pen } = this;
    this.frames++;
    pen.clearRect(0, 0, this.width, this.height);
    pen.lineCap = pen.lineJoin = "round";
    for (const layer of this.behind) this.layer(layer);
    if (this.grid) this.paintGrid();
    for (const layer of this.under) this.layer(layer);
    if (this.shown) this.paintMechanism(this.shown);
    for (const layer of this.over) this.layer(layer);
    if (this.shown && this.names) this.paintNames(this.shown);
    this.paintScale();
  }

  layer(paint) { this.pen.save(); paint(this.pen, this); this.pen.restore(); }

  colour(name) { return this.bench.colours.of(name); }

  paintGrid() {
    const { pen, step } = this, [left, bottom, right, top] = this.limits;
    for (const [every, alpha] of [[1, 0.35], [5, 0.9]]) {
      const d = every * step;
      pen.strokeStyle = this.colour("grid"); pen.globalAlpha = alpha; pen.lineWidth = 1;
      pen.beginPath();
      for (let x = Math.ceil(left / d) * d; x <= right; x += d) { const [px] = this.px(x, 0); pen.moveTo(px, 0); pen.lineTo(px, this.height); }
      for (let y = Math.ceil(bottom / d) * d; y <= top; y += d) { const [, py] = this.px(0, y); pen.moveTo(0, py); pen.lineTo(this.width, py); }
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  // A path through points in metres; null begins anew.
  trace(points) {
    const { pen } = this;
    pen.beginPath();
    let begun = false;
    for (const point of points) {
      if (!point) { begun = false; continue; }
      const [x, y] = this.px(point[0], point[1]);
      if (begun) pen.lineTo(x, y); else pen.moveTo(x, y);
      begun = true;
    }
  }

  paintMechanism(shown) {
    const { pen } = this, { looks } = this.bench;
    this.paintMarks(shown.marks.filter(([when]) => when === "still"), looks);
    shown.bodies.forEach(([name, points, plate], k) => {
      const chosen = this.bench.isSelected("body", name);
      if (chosen) { pen.strokeStyle = this.colour("accent"); pen.globalAlpha = 0.35; pen.lineWidth = 13; this.trace(points); pen.stroke(); pen.globalAlpha = 1; }
      pen.strokeStyle = this.colour("card"); pen.lineWidth = 7; this.trace(points); pen.stroke();
      pen.strokeStyle = pen.fillStyle = this.bench.bodyColour?.(name, k) ?? this.bench.colours.link(k);
      if (points.length === 1) { pen.beginPath(); pen.arc(...this.px(...points[0]), 5, 0, 7); pen.fill(); return; }
      this.trace(points);
      if (plate) { pen.globalAlpha = 0.22; pen.fill(); pen.globalAlpha = 1; }
      pen.lineWidth = 4; pen.stroke();
      this.overBody?.(name);
    });
    this.paintMarks(shown.marks.filter(([when]) => when !== "still"), looks);
    this.paintPoints(shown);
  }

  paintMarks(marks, looks) {
    const { pen } = this;
    for (const [, look, name, points] of marks) {
      const chosen = name && ACTING.includes(look) && this.bench.selected.some((one) => one.name === name && one.kind.includes(look));
      const [fill, stroke, width, dashed] = looks[look] ?? ["", "sensor", 1.4, false];
      pen.setLineDash(dashed ? [6, 4] : []);
      pen.lineWidth = 1.3 * width; pen.strokeStyle = this.colour(chosen ? "accent" : stroke);
      if (points.length > 1) this.trace(points);
      else { pen.beginPath(); pen.arc(...this.px(...points[0]), 4, 0, 2 * Math.PI); }
      if (fill) { pen.fillStyle = this.colour(fill); pen.fill(); }
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  // Points that no joint covers, the end-effector, open joints, and what is selected.
  paintPoints(shown) {
    const { pen } = this;
    const covered = new Set(shown.joints.map(([, , x, y]) => `${x} ${y}`));
    for (const [ref, x, y] of shown.points) {
      const [px, py] = this.px(x, y);
      if (ref === shown.effector) { pen.fillStyle = this.colour("trail"); pen.beginPath(); pen.arc(px, py, 5, 0, 7); pen.fill(); }
      else if (!covered.has(`${x} ${y}`)) { pen.strokeStyle = this.colour("ink"); pen.lineWidth = 1.4; pen.beginPath(); pen.moveTo(px - 4, py); pen.lineTo(px + 4, py); pen.moveTo(px, py - 4); pen.lineTo(px, py + 4); pen.stroke(); }
      if (this.bench.isSelected("point", ref)) this.ring(px, py);
    }
    for (const [name, , x, y] of shown.joints) {
      const [px, py] = this.px(x, y);
      if (this.bench.isSelected("joint", name)) this.ring(px, py);
      if (name in shown.open) { pen.strokeStyle = this.colour("mark"); pen.setLineDash([3, 3]); pen.lineWidth = 2; pen.beginPath(); pen.arc(px, py, 13, 0, 7); pen.stroke(); pen.setLineDash([]); }
    }
  }

  ring(px, py) {
    const { pen } = this;
    pen.strokeStyle = this.colour("accent"); pen.lineWidth = 2.5;
    pen.beginPath(); pen.arc(px, py, 11, 0, 2 * Math.PI); pen.stroke();
  }

  paintNames(shown) {
    const { pen } = this;
    pen.font = "600 11.5px system-ui, sans-serif"; pen.textBaseline = "middle";
    const labels = [], taken = [], written = new Set();
    const add = (text, key, [x, y], colour, clear = 0) => { labels.push({ text, key, x, y, colour, clear, wide: pen.measureText(text).width }); };
    const atJoint = new Map(), clear = new Map(); // radius of what is painted around a place [px]
    for (const [, look, , points] of shown.marks) {
      if (look === "ground") taken.push(...alongLine(points.filter(Boolean).map((point) => this.px(...point))));
      if (!["motor", "block", "weld"].includes(look)) continue;
      const [xs, ys] = [0, 1].map((k) => points.filter(Boolean).map((point) => this.px(...point)[k]));
      const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
      clear.set(`${Math.round((left + right) / 2)} ${Math.round((top + bottom) / 2)}`, Math.max(right - left, bottom - top) / 2);
    }
    for (const { kind, name } of this.bench.selected) {
      const [x, y] = ((kind === "joint" ? shown.joints : shown.points).find(([one]) => one === name) ?? []).slice(kind === "joint" ? 2 : 1);
      if (x !== undefined) clear.set(this.px(x, y).map(Math.round).join(" "), 13);
    }
    for (const [name, , x, y] of shown.joints) {
      const place = this.px(x, y), where = `${Math.round(place[0])} ${Math.round(place[1])}`;
      taken.push(place);
      atJoint.set(where, [...(atJoint.get(where) ?? []), name]);
    }
    for (const [where, names] of atJoint) add(names.join(", "), `joint ${names[0]}`, where.split(" ").map(Number), this.colour("soft"), clear.get(where));
    for (const [ref, x, y] of shown.points) {
      const place = this.px(x, y), where = `${Math.round(place[0])} ${Math.round(place[1])}`;
      if (!atJoint.has(where)) { add(ref.split(".").pop(), `point ${ref}`, place, this.colour("soft"), clear.get(where)); taken.push(place); }
    }
    for (const [, look, name, points] of shown.marks) if (name && ACTING.includes(look) && !written.has(name)) { written.add(name); add(name, `${look} ${name}`, this.px(...points[0]), this.colour(look === "load" ? "trail" : "soft")); }
    shown.bodies.forEach(([name, points], k) => {
      const pixels = points.filter(Boolean).map((point) => this.px(...point)), middle = pixels[Math.floor((pixels.length - 1) / 2)], next = pixels[Math.ceil((pixels.length - 1) / 2)];
      taken.push(...alongLine(pixels));
      add(name, name, [(middle[0] + next[0]) / 2, (middle[1] + next[1]) / 2], this.bench.colours.link(k));
    });
    placeNames(labels, taken, this.stands, this.width, this.height);
    pen.textAlign = "center"; pen.lineWidth = 4; pen.strokeStyle = this.colour("card");
    for (const { text, at, colour } of labels) { pen.strokeText(text, ...at); pen.fillStyle = colour; pen.fillText(text, ...at); }
    pen.textAlign = "start";
  }

  paintScale() {
    const { pen } = this, target = 110 / this.scale, power = 10 ** Math.floor(Math.log10(target));
    const length = power * [5, 2, 1].find((digit) => digit * power <= target), x = 14, y = this.height - 14;
    const text = length >= 1 ? `${length} m` : length >= 1e-3 ? `${+(1000 * length).toPrecision(1)} mm` : `${+(1e6 * length).toPrecision(1)} µm`;
    pen.strokeStyle = this.colour("soft"); pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(x, y - 4); pen.lineTo(x, y); pen.lineTo(x + length * this.scale, y); pen.lineTo(x + length * this.scale, y - 4); pen.stroke();
    pen.fillStyle = this.colour("soft"); pen.font = "12px system-ui, sans-serif"; pen.textBaseline = "alphabetic";
    pen.fillText(text, x + 6, y - 6);
  }

  // What lies under a place in pixels: {kind: "joint" | "point" | "body", name, at}; null for nothing.
  hit(px, py, near = NEAR) {
    const { shown } = this;
    if (!shown) return null;
    let best = null, least = near;
    const offer = (kind, name, x, y) => {
      const [qx, qy] = this.px(x, y), far = Math.hypot(px - qx, py - qy);
      if (far < least) { least = far; best = { kind, name, at: [x, y] }; }
    };
    for (const [name, , x, y] of shown.joints) offer("joint", name, x, y);
    for (const [ref, x, y] of shown.points) offer("point", ref, x, y);
    return best ?? this.hitBody(px, py) ?? this.hitMark(px, py) ?? this.hitPath(px, py);
  }

  // A spring, a load or a sensor, which have no place of their own.
  hitMark(px, py) {
    const found = this.shown.marks.find(([, look, name, points]) => name && ACTING.includes(look) && this.near(px, py, points, 7));
    const thing = found && (this.bench.state.outline ?? []).find(({ kind, name }) => name === found[2] && kind.includes(found[1]));
    return thing ? { kind: thing.kind, name: thing.name, at: this.metres(px, py) } : null;
  }

  hitPath(px, py) {
    const { path, path_name: name } = this.bench.state.seen ?? {};
    return name && path?.length && this.near(px, py, path, 6) ? { kind: "path", name, at: this.metres(px, py) } : null;
  }

  near(px, py, points, least) {
    const pixels = points.filter(Boolean).map((point) => this.px(...point));
    return pixels.some((end, k) => toSegment([px, py], pixels[Math.max(k - 1, 0)], end)[1] < least);
  }

  // The link below a place, other than some.
  hitBody(px, py, others = []) {
    let best = null, least = 8;
    for (const [name, points, plate] of this.shown.bodies) {
      if (others.includes(name)) continue;
      const pixels = points.filter(Boolean).map((point) => this.px(...point));
      for (let k = 1; k < pixels.length; k++) {
        const [foot, far] = toSegment([px, py], pixels[k - 1], pixels[k]);
        if (far < least) { least = far; best = { kind: "body", name, at: this.metres(px, py), foot: this.metres(...foot) }; }
      }
      if (plate && !best && inside([px, py], pixels)) best = { kind: "body", name, at: this.metres(px, py) };
    }
    return best;
  }
}

// The place on a segment that is nearest to another one, and how far that is.
function toSegment([x, y], [ax, ay], [bx, by]) {
  const dx = bx - ax, dy = by - ay, long = dx * dx + dy * dy;
  const share = long ? Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / long)) : 0;
  return [[ax + share * dx, ay + share * dy], Math.hypot(x - ax - share * dx, y - ay - share * dy)];
}

function inside([x, y], corners) {
  let within = false;
  for (let i = 0, j = corners.length - 1; i < corners.length; j = i++) {
    const [xi, yi] = corners[i], [xj, yj] = corners[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) within = !within;
  }
  return within;
}
