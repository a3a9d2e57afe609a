import { Dragging } from "./dragging.js";
import { Drawing } from "./drawing.js";
import { button, element } from "./elements.js";
import { icon } from "./icons.js";
import { Painting } from "./painting.js";

// Tools in groups: name, label, key, what the cursor is, and what to do next.
const GROUPS = [
  [["select", "Select, move", "v", "default", "Drag a link or a joint: the mechanism follows. A click or a box selects."],
    ["shape", "Lengths", "a", "move", "Drag a point: lengths of links change, the file follows."]],
  [["ground", "Ground point", "g", "crosshair", "Click where the mechanism is fixed, or on the end of a link to hold it there."],
    ["link", "Link", "l", "crosshair", "Press at one end and drag to the other, or click both; Shift: more points."],
    ["beam", "Flexible link", "b", "crosshair", "Press at one end of the beam and drag to the other, or click both."],
    ["plate", "Link of points", "t", "crosshair", "Click each point of the link; Enter or a click on the last one ends it."],
    ["point", "Further point", "o", "crosshair", "Click on a link: it gets a point there. Press on a link and release beside it: the point is there."]],
  [["revolute", "Revolute joint", "r", "pointer", "Click a point, then the point to which it is joined."],
    ["slider", "Slider", "s", "crosshair", "Press at a point and drag along the rail; a click: a horizontal rail, or a slot along the link below the point."],
    ["weld", "Weld", "w", "pointer", "Click a point, then the point to which it is welded; on a joint: it becomes a weld."]],
  [["motor", "Motor", "m", "pointer", "Click the joint that a motor turns: runs compute its torque."],
    ["drive", "Drive", "d", "pointer", "Click the joint of a crank: it turns at constant speed."],
    ["gear", "Gear", "k", "pointer", "Click one joint, then the one that turns with it."],
    ["spring", "Spring", "x", "pointer", "Click a joint, or drag from one point to another."],
    ["damper", "Damper", "c", "pointer", "Click a joint, or two points."],
    ["load", "Force", "f", "crosshair", "Press at a point of a link and drag the force; a click: 10 N downwards."],
    ["lump", "Lumped mass", "u", "pointer", "Click a point of a flexible link."]],
  [["sensor", "Sensor", "n", "pointer", "Click a joint (its angle), a point (its position) or a flexible link (its strain)."],
    ["effector", "End-effector", "e", "pointer", "Click the point that follows paths and draws curves; on a link: a new point."],
    ["path", "Path", "p", "crosshair", "Drag a line, or click corners; Enter or a click on the last one ends it."]],
];
const TOOLS = new Map(GROUPS.flat().map(([name, label, key, cursor, hint]) => [name, { name, label, key, cursor, hint }]));
const CLICK = 5; // distance [px]

export class Tools {
  constructor(bench) {
    this.bench = bench;
    this.sheet = bench.sheet;
    this.pointers = new Map();
    this.tool = TOOLS.get("select");
    this.dragging = new Dragging(bench, this);
    this.drawing = new Drawing(bench, this);
    this.painting = new Painting(bench, this);
    this.layOut();
    const { canvas } = this.sheet;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => this.up(event, kind === "pointercancel"));
    canvas.addEventListener("pointerleave", () => { if (!this.held) { this.hover = null; this.sheet.repaint(); } });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", (event) => this.doubled(event));
    for (const what of ["state", "reach"]) bench.on(what, () => this.showReady());
    this.choose("select");
  }

  layOut() {
    const { tools, stage } = this.bench.parts;
    this.buttons = new Map();
    for (const group of GROUPS) {
      const box = element("div", { class: "group" });
      for (const [name, label, key, , hint] of group) {
        const made = element("button", { type: "button", title: `${label} (${key.toUpperCase()})\n${hint}`, "aria-pressed": "false", onclick: () => this.choose(name) },
          icon(name), element("span", {}, label), element("kbd", {}, key.toUpperCase()));
        this.buttons.set(name, made);
        box.append(made);
      }
      tools.append(box);
    }
    this.hint = element("span", { class: "hint" });
    this.ready = button("", "What stands in the way of a run: click to go there", () => this.goReady(), { class: "ready", "aria-label": null });
    stage.append(element("div", { class: "status" }, this.hint, this.ready));
  }

  get isDrawing() { return this.tool.name !== "select" && this.tool.name !== "shape"; }

  choose(name) {
    this.tool = TOOLS.get(name) ?? this.tool;
    this.drawing.begun = [];
    this.cursor = this.picking = null;
    for (const [one, made] of this.buttons) made.setAttribute("aria-pressed", one === this.tool.name);
    this.sheet.canvas.style.cursor = this.tool.cursor;
    this.showHint();
    this.sheet.repaint();
    this.bench.start?.hide();
  }

  chooseByKey(key) {
    const found = [...TOOLS.values()].find((one) => one.key === key.toLowerCase());
    if (found) this.choose(found.name);
    return !!found;
  }

  showHint() {
    const left = this.drawing.begun.length, { name, hint } = this.tool;
    let text = hint;
    if (this.picking) text = this.picking.hint;
    else if (left && ["link", "beam"].includes(name)) text = left === 1 ? "Click the other end; Shift for a link with more points, Escape to stop." : "Click the next point; Enter or a click on the last one ends the link.";
    else if (left && ["plate", "path"].includes(name)) text = `${left} point${left > 1 ? "s" : ""}: click the next one; Enter ends, Escape stops.`;
    else if (left) text = "Now click the other one; Escape to stop.";
    this.hint.textContent = text;
  }

  showReady() {
    const { ready } = this.bench.state;
    this.ready.hidden = !ready || !ready.sentence;
    if (!ready) return;
    this.ready.textContent = ready.sentence;
    this.ready.dataset.ok = !!ready.ok;
    this.ready.title = [ready.ok ? "Run" : "Click to go there", ...(this.bench.state.findings ?? [])].join("\n");
  }

  goReady() {
    const { place, action } = this.bench.state.ready ?? {};
    const tool = String(action?.kind ?? action ?? "").replace(/^(add|set)-/, "").replace("joint", "revolute");
    if (action === "run") { this.bench.motion?.run?.(); return; }
    if (TOOLS.has(tool)) this.choose(tool);
    if (place?.length) this.bench.goTo(place);
  }

  // Several clicks for another part of the page, as for the scale of a photograph.
  pick(count, hint, done) {
    this.choose("select");
    this.picking = { count, hint, done, places: [] };
    this.sheet.canvas.style.cursor = "crosshair";
    this.showHint();
  }

  escape() {
    if (this.held) this.cancel();
    else if (this.drawing.begun.length) { this.drawing.begun = []; this.showHint(); } else if (this.tool.name !== "select" || this.picking) this.choose("select");
    else this.bench.select(null);
    this.sheet.repaint();
  }

  // Enter: sets a point at the cursor of the arrows, or ends what has enough points.
  enter() {
    if (this.cursor && this.picking) this.picked(this.cursor);
    else if (this.cursor && !this.drawing.sameAsLast(this.cursor)) this.drawing.clicked(this.cursor, {});
    else this.drawing.finish();
  }

  // Arrows move a cursor for drawing without a pointer.
  arrow([dx, dy]) {
    if (!this.isDrawing && !this.picking) return false;
    const { step } = this.sheet, [x, y] = this.cursor?.at ?? this.drawing.begun.at(-1)?.at ?? this.sheet.centre.map((one) => Math.round(one / step) * step);
    this.cursor = this.hover = this.snap(...this.sheet.px(x + dx * step, y + dy * step), {}, 4);
    this.sheet.repaint();
    return true;
  }

  // The space bar moves the sheet while it is held; returns on release whether it did.
  space(held) {
    const used = this.spaceUsed;
    this.spaceHeld = held;
    if (held) { if (!this.panning) this.spaceUsed = false; } else this.spaceUsed = false;
    this.sheet.canvas.style.cursor = held ? "grab" : this.tool.cursor;
    return used;
  }

  where(event) {
    const box = this.sheet.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    const px = this.where(event);
    this.sheet.canvas.focus({ preventScroll: true });
    this.sheet.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, px);
    this.cursor = this.under = null;
    if (event.pointerType === "touch" && this.pointers.size === 2) { this.cancel(); this.pinch = this.spread(); return; }
    if (this.pinch || this.pointers.size > 1) return;
    if (event.button === 1 || event.button === 2 || this.spaceHeld) {
      this.panning = px;
      this.spaceUsed = true;
      this.sheet.canvas.style.cursor = "grabbing";
      return;
    }
    this.bench.start?.hide();
    this.held = { from: px, far: false, start: this.snap(...px, event), shift: event.shiftKey };
    if (this.tool.name === "select" && !this.picking) this.dragging.press(px, event, this.held);
    if (this.tool.name === "shape") this.held.ref = this.held.start.ref;
    this.moved(event);
  }

  // The grid does not attract what is picked on a photograph.
  snap(px, py, { altKey, pointerType }, near) {
    const event = { altKey: altKey || !!this.picking, pointerType };
    return this.sheet.places.snap(px, py, event, this.drawing.begun, near);
  }

  spread() {
    const [[ax, ay], [bx, by]] = [...this.pointers.values()];
    return { x: (ax + bx) / 2, y: (ay + by) / 2, far: Math.hypot(ax - bx, ay - by) || 1 };
  }

  moved(event) {
    const px = this.where(event);
    if (this.pointers.has(event.pointerId)) this.pointers.set(event.pointerId, px);
    if (this.pinch && this.pointers.size >= 2) {
      const now = this.spread();
      this.sheet.zoom(now.far / this.pinch.far, now.x, now.y);
      this.sheet.move((this.pinch.x - now.x) / this.sheet.scale, (now.y - this.pinch.y) / this.sheet.scale);
      this.pinch = now;
      return;
    }
    if (this.panning) {
      this.sheet.move((this.panning[0] - px[0]) / this.sheet.scale, (px[1] - this.panning[1]) / this.sheet.scale);
      this.panning = px;
      return;
    }
    this.pointer = px;
    this.hover = this.snap(...px, event);
    const { held } = this;
    if (held) {
      held.far ||= Math.hypot(px[0] - held.from[0], px[1] - held.from[1]) > CLICK;
      if (held.far && held.drags) this.dragging.send(px, held);
      else if (held.far && held.under) this.bench.say("The ground stays where it is; the tool Lengths (A) moves its points.");
      if (held.box !== undefined && held.far) held.box = px;
    } else if (this.tool.name === "select" && !this.picking) {
      this.under = this.sheet.hit(...px);
      this.sheet.canvas.style.cursor = this.spaceHeld ? "grab" : this.under ? "pointer" : "default";
    }
    this.sheet.repaint();
  }

  up(event, cancelled) {
    this.pointers.delete(event.pointerId);
    if (this.pinch) { if (!this.pointers.size) this.pinch = null; return; }
    if (this.panning) { this.panning = null; this.sheet.canvas.style.cursor = this.spaceHeld ? "grab" : this.tool.cursor; return; }
    const { held } = this;
    if (!held) return;
    this.held = null;
    if (cancelled) { this.hover = null; this.dragging.end(held); return; }
    const end = this.snap(...this.where(event), event);
    if (this.picking) this.picked(end);
    else if (this.tool.name === "select") this.dragging.release(held, event);
    else if (this.tool.name === "shape") this.releaseShape(held, end);
    else this.drawing.released(held, end, event);
    this.sheet.repaint();
  }

  cancel() {
    const { held } = this;
    this.held = null;
    this.drawing.begun = [];
    if (held) this.dragging.end(held);
    this.showHint();
    this.sheet.repaint();
  }

  picked(place) {
    const { picking } = this;
    picking.places.push(place.at);
    if (picking.places.length < picking.count) return;
    this.choose("select");
    picking.done(...picking.places);
  }

  doubled(event) {
    if (this.tool.name === "select" && this.sheet.hit(...this.where(event))) this.bench.showTab("properties");
  }

  releaseShape(held, end) {
    if (!held.ref) { this.bench.say("Press at a point or a joint: it goes where you drag it.", "error"); return; }
    if (!held.far) { this.bench.select(this.sheet.hit(...held.from)); return; }
    this.bench.act({ kind: "move-point", ref: held.ref, to: end.ref === held.ref ? this.sheet.metres(...this.pointer) : end.at });
  }
}
