import { button, degrees, element, quantity } from "./elements.js";
import { icon } from "./icons.js";

// Tools in groups: name, label, key, what the cursor is, and what to do next.
const GROUPS = [
  [["select", "Select, move", "v", "default", "Drag a link or a joint: the mechanism follows. Click selects; a box selects several."],
    ["shape", "Lengths", "a", "move", "Drag a point: lengths of links change, the file follows."]],
  [["ground", "Ground point", "g", "crosshair", "Click where the mechanism is fixed, or on the end of a link to hold it there."],
    ["link", "Link", "l", "crosshair", "Press at one end and drag to the other, or click both; Shift: more points."],
    ["beam", "Flexible link", "b", "crosshair", "Press at one end of the beam and drag to the other, or click both."],
    ["plate", "Link of points", "t", "crosshair", "Click each point of the link; Enter or a click on the last one ends it."],
    ["point", "Further point", "o", "crosshair", "Click on a link: it gets a point there."]],
  [["revolute", "Revolute joint", "r", "pointer", "Click a point, then the point to which it is joined."],
    ["slider", "Slider", "s", "crosshair", "Press at a point and drag along the rail; a click makes a horizontal rail."],
    ["weld", "Weld", "w", "pointer", "Click a point, then the point to which it is welded."]],
  [["motor", "Motor", "m", "pointer", "Click the joint that a motor turns: runs compute its torque."],
    ["drive", "Drive", "d", "pointer", "Click the joint of a crank: it turns at constant speed."],
    ["gear", "Gear", "k", "pointer", "Click one joint, then the one that turns with it."],
    ["spring", "Spring", "x", "pointer", "Click a joint, or drag from one point to another."],
    ["damper", "Damper", "c", "pointer", "Click a joint."],
    ["load", "Force", "f", "crosshair", "Press at a point of a link and drag the force; a click: 10 N downwards."],
    ["lump", "Lumped mass", "u", "pointer", "Click a point of a flexible link."]],
  [["sensor", "Sensor", "n", "pointer", "Click a joint (its angle), a point (its position) or a flexible link (its strain)."],
    ["effector", "End-effector", "e", "pointer", "Click the point that follows paths and draws curves; on a link: a new point."],
    ["path", "Path", "p", "crosshair", "Drag a line, or click corners; Enter or a click on the last one ends it."]],
];
const TOOLS = new Map(GROUPS.flat().map(([name, label, key, cursor, hint]) => [name, { name, label, key, cursor, hint }]));
const SNAP = 13, CLICK = 5; // distances [px]
const TURN = Math.PI / 12; // step of directions
const FORCE = 0.2; // N/px
const STOPS = { reach: "out of reach", singular: "singular position" };

// Sends what changes with every move: one message on its way at most, the newest is kept.
export class Newest {
  constructor(bench, what, take) {
    Object.assign(this, { bench, what, take, next: null, flight: null });
  }

  send(fields) {
    this.next = fields;
    this.flight ??= this.run();
  }

  async run() {
    while (this.next) {
      const fields = this.next;
      this.next = null;
      try { this.take(await this.bench.link.ask(this.what, fields)); } catch (error) { this.bench.say(error.text ?? String(error), "error"); }
    }
    this.flight = null;
  }

  async end() { while (this.flight) await this.flight; }
}

export class Tools {
  constructor(bench) {
    this.bench = bench;
    this.sheet = bench.sheet;
    this.pointers = new Map();
    this.drag = new Newest(bench, "drag", (found) => this.dragged(found));
    this.tool = TOOLS.get("select");
    this.begun = []; // ends of a link or path that is being drawn: {at, ref}
    this.layOut();
    const { canvas } = this.sheet;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => this.up(event, kind === "pointercancel"));
    canvas.addEventListener("pointerleave", () => { if (!this.held) { this.hover = null; this.sheet.repaint(); } });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", (event) => this.doubled(event));
    this.sheet.over.push((pen) => this.paint(pen));
    bench.on("state", () => { this.posed.hidden = true; this.showReady(); });
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
    this.ready = button("", "What stands in the way of a run: click to go there", () => this.goReady(), { class: "ready" });
    this.badge = element("span", { class: "badge", hidden: true });
    this.posed = element("div", { class: "posed", hidden: true },
      button("Keep this pose", "The dragged pose becomes the assembly of the file", () => this.bench.request("pose"), { class: "main" }),
      button("Back", "The assembly of the file again", () => this.back()));
    stage.append(element("div", { class: "status" }, this.hint, this.ready), this.badge, this.posed);
  }

  // Tools and their states.

  get isDrawing() { return this.tool.name !== "select" && this.tool.name !== "shape"; }

  choose(name) {
    this.tool = TOOLS.get(name) ?? this.tool;
    this.begun = [];
    this.cursor = this.picking = null;
    for (const [one, made] of this.buttons) made.setAttribute("aria-pressed", one === this.tool.name);
    this.sheet.canvas.style.cursor = this.tool.cursor;
    this.tellHint();
    this.sheet.repaint();
    this.bench.start?.hide();
  }

  chooseByKey(key) {
    const found = [...TOOLS.values()].find((one) => one.key === key.toLowerCase());
    if (found) this.choose(found.name);
    return !!found;
  }

  tellHint() {
    const left = this.begun.length, { name, hint } = this.tool;
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
  }

  goReady() {
    const { place, action } = this.bench.state.ready ?? {};
    const tool = String(action?.kind ?? action ?? "").replace(/^(add|set)-/, "").replace("joint", "revolute");
    if (TOOLS.has(tool)) this.choose(tool);
    if (place?.length) this.bench.goTo(place);
  }

  // Several clicks for another part of the page, as for the scale of a photograph.
  pick(count, hint, done) {
    this.choose("select");
    this.picking = { count, hint, done, places: [] };
    this.sheet.canvas.style.cursor = "crosshair";
    this.tellHint();
  }

  escape() {
    if (this.held) this.cancel();
    else if (this.begun.length) { this.begun = []; this.tellHint(); } else if (this.tool.name !== "select" || this.picking) this.choose("select");
    else this.bench.select(null);
    this.sheet.repaint();
  }

  // Enter: sets a point at the cursor of the arrows, or ends what has enough points.
  enter() {
    if (this.cursor && !this.sameAsLast(this.cursor)) this.clicked(this.cursor, {});
    else this.finish();
  }

  // Arrows move a cursor for drawing without a pointer.
  arrow([dx, dy]) {
    if (!this.isDrawing && !this.picking) return false;
    const { step } = this.sheet, [x, y] = this.cursor?.at ?? this.begun.at(-1)?.at ?? this.sheet.centre.map((one) => Math.round(one / step) * step);
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

  // Places.

  // The place to which a pointer snaps: a point of the mechanism (its ref), or the grid.
  snap(px, py, event, near = SNAP) {
    let best = null, least = event.pointerType === "touch" ? 2 * near : near;
    for (const [ref, x, y] of this.sheet.shown?.points ?? []) {
      const [qx, qy] = this.sheet.px(x, y), far = Math.hypot(px - qx, py - qy);
      if (far < least - 1e-6) { least = far; best = { at: [x, y], ref, px: [qx, qy] }; }
    }
    for (const one of this.begun) {
      const [qx, qy] = this.sheet.px(...one.at), far = Math.hypot(px - qx, py - qy);
      if (far < least - 1e-6) { least = far; best = { at: one.at, ref: one.ref, px: [qx, qy] }; }
    }
    return best ?? this.onGrid(px, py, event);
  }

  onGrid(px, py, event) {
    const { step } = this.sheet, free = this.sheet.metres(px, py);
    const at = event.altKey || !this.sheet.grid ? free : free.map((one) => +(Math.round(one / step) * step).toPrecision(9));
    return { at: at.map((one) => +one.toFixed(9)), ref: null, px: this.sheet.px(...at) };
  }

  // The points of bodies and ground at a place, ground first.
  refsAt([x, y]) {
    const near = 1 / this.sheet.scale;
    return (this.sheet.shown?.points ?? []).filter(([, a, b]) => Math.hypot(a - x, b - y) < near).map(([ref]) => ref);
  }

  jointsAt([x, y]) {
    const near = 3 / this.sheet.scale;
    return (this.sheet.shown?.joints ?? []).filter(([, , a, b]) => Math.hypot(a - x, b - y) < near).map(([name]) => name);
  }

  // [ref, x, y] of something selected that is one point; of a joint the ground's, or that of a body.
  pointOf({ kind, name }) {
    const shown = this.sheet.shown ?? { points: [], joints: [] };
    if (kind === "point") return shown.points.find(([ref]) => ref === name);
    const joint = kind === "joint" && shown.joints.find(([one]) => one === name);
    return joint ? shown.points.find(([ref]) => ref === this.refsAt([joint[2], joint[3]])[0]) : undefined;
  }

  // Pointers.

  where(event) {
    const box = this.sheet.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    const px = this.where(event);
    this.sheet.canvas.focus({ preventScroll: true });
    this.sheet.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, px);
    this.cursor = null;
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
    if (this.tool.name === "select" && !this.picking) this.pressSelect(px, event);
    if (this.tool.name === "shape") this.held.ref = this.held.start.ref;
    this.moved(event);
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
      if (held.far && held.drags) this.sendDrag(px);
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
    if (cancelled) { this.hover = null; this.endDrag(held); return; }
    const end = this.snap(...this.where(event), event);
    if (this.picking) this.picked(end);
    else if (this.tool.name === "select") this.releaseSelect(held, event);
    else if (this.tool.name === "shape") this.releaseShape(held, end);
    else this.released(held, end, event);
    this.sheet.repaint();
  }

  cancel() {
    const { held } = this;
    this.held = null;
    this.begun = [];
    if (held) this.endDrag(held);
    this.tellHint();
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

  // Selecting, and moving the mechanism.

  pressSelect(px, event) {
    const under = this.sheet.hit(...px, event.pointerType === "touch" ? 22 : undefined);
    this.held.under = under;
    if (!under) { this.held.box = null; return; }
    if (!this.bench.isSelected(under.kind, under.name) && !event.shiftKey) this.bench.select(under);
    const ref = under.kind === "body" ? null : this.refsAt(under.at).find((one) => !one.startsWith("ground."));
    const at = under.kind === "body" ? this.sheet.metres(...px) : under.at;
    if (ref && !this.refsAt(under.at).some((one) => one.startsWith("ground."))) this.held.drags = { point: ref };
    else if (under.kind === "body") this.held.drags = this.gripOn(under.name, at);
  }

  // A place on a body in its own frame.
  gripOn(body, [x, y]) {
    const frame = this.sheet.shown.frames?.[body];
    if (!frame) return null;
    const [ox, oy, angle] = frame, c = Math.cos(angle), s = Math.sin(angle);
    return { body, local: [c * (x - ox) + s * (y - oy), c * (y - oy) - s * (x - ox)] };
  }

  sendDrag(px) {
    this.held.sent = true;
    this.bench.motion?.stop?.();
    this.sheet.canvas.style.cursor = "grabbing";
    this.drag.send({ ...this.held.drags, to: this.sheet.metres(...px) });
  }

  dragged({ picture, seen, stop, problem }) {
    const { state } = this.bench;
    if (picture) state.picture = picture;
    if (seen) state.seen = { ...state.seen, ...seen };
    const word = problem ? problem.text ?? problem : STOPS[stop] ?? "";
    this.badge.hidden = !word || !this.held;
    this.badge.textContent = word;
    if (this.pointer) this.badge.style.transform = `translate(${Math.min(this.pointer[0] + 16, this.sheet.width - 150)}px, ${this.pointer[1] + 14}px)`;
    this.bench.notify("picture");
  }

  async endDrag(held) {
    this.badge.hidden = true;
    this.sheet.canvas.style.cursor = this.tool.cursor;
    if (!held.sent) return;
    await this.drag.end();
    const found = await this.bench.request("drop");
    if (!found) return;
    this.posed.hidden = false;
    this.dragged(found);
  }

  async back() {
    const found = await this.bench.request("back");
    this.posed.hidden = true;
    if (found) this.dragged(found);
  }

  releaseSelect(held, event) {
    if (held.sent) { this.endDrag(held); return; }
    if (held.box) { this.selectBox(held.from, held.box, event.shiftKey); return; }
    if (!held.under) { if (!event.shiftKey) this.bench.select(null); } else if (event.shiftKey) this.bench.select(held.under, true);
    else this.bench.select(held.under);
    if (held.under) this.bench.fieldsWanted();
  }

  selectBox([ax, ay], [bx, by], more) {
    const { shown } = this.sheet;
    if (!shown) return;
    const within = ([x, y]) => { const [px, py] = this.sheet.px(x, y); return (px - ax) * (px - bx) <= 0 && (py - ay) * (py - by) <= 0; };
    const free = new Set(shown.points.map(([ref]) => ref));
    for (const [, , x, y] of shown.joints) for (const ref of this.refsAt([x, y])) free.delete(ref);
    const found = [
      ...shown.bodies.filter(([, points]) => points.filter(Boolean).every(within)).map(([name]) => ({ kind: "body", name })),
      ...shown.joints.filter(([, , x, y]) => within([x, y])).map(([name]) => ({ kind: "joint", name })),
      ...shown.points.filter(([ref, x, y]) => free.has(ref) && within([x, y])).map(([name]) => ({ kind: "point", name })),
    ];
    this.bench.selected = more ? [...this.bench.selected.filter((one) => !found.some((each) => each.kind === one.kind && each.name === one.name)), ...found] : found;
    this.bench.notify("selected");
  }

  releaseShape(held, end) {
    if (!held.ref) { this.bench.say("Press at a point or a joint: it goes where you drag it.", "error"); return; }
    if (!held.far) { this.bench.select(this.sheet.hit(...held.from)); return; }
    this.bench.act({ kind: "move-point", ref: held.ref, to: end.ref === held.ref ? this.sheet.metres(...this.pointer) : end.at });
  }

  // Drawing.

  // A press and its release with a tool that draws: a drag has two places, a click one.
  released(held, end, event) {
    const { name } = this.tool, dragged = held.far && !this.sameplace(held.start, end);
    if (name === "slider") this.addSlider(held.start, dragged ? this.direction(held.start, event) : 0);
    else if (name === "load") this.addLoad(held.start, dragged ? this.force(held.start) : [0, -10]);
    else if (dragged && !this.begun.length && ["link", "beam", "path", "spring", "damper", "revolute", "weld", "gear", "plate"].includes(name)) {
      this.clicked(held.start, event, true);
      this.clicked(end, event, true);
    } else this.clicked(end, event);
  }

  sameplace(a, b) { return Math.hypot(a.px[0] - b.px[0], a.px[1] - b.px[1]) < 4; }
  sameAsLast(place) { return this.begun.length > 0 && this.sameplace({ px: this.sheet.px(...this.begun.at(-1).at) }, place); }

  // A click with a tool; `drawn` if it is an end of a drag.
  clicked(place, event, drawn = false) {
    const { name } = this.tool;
    const click = {
      ground: () => this.addGround(place), point: () => this.addPoint(place), lump: () => this.onPoint(place, "add-lump", "a point of a flexible link"),
      motor: () => this.onJoint(place, "add-motor"), drive: () => this.onJoint(place, "add-drive"), effector: () => this.setEffector(place), sensor: () => this.addSensor(place),
      gear: () => this.twoJoints(place), spring: () => this.atJointOrPoints(place, "add-spring", drawn), damper: () => this.atJointOrPoints(place, "add-damper", drawn),
      revolute: () => this.joinPoints(place, "revolute"), weld: () => this.joinPoints(place, "weld"), slider: () => this.addSlider(place, 0), load: () => this.addLoad(place, [0, -10]),
    }[name];
    if (this.picking) this.picked(place);
    else if (click) click();
    else this.nextPoint(place, event.shiftKey);
    this.tellHint();
  }

  // The next point of a link or path; a link has two unless more are asked for.
  nextPoint(place, more) {
    if (this.sameAsLast(place)) { this.finish(); return; }
    this.begun.push({ at: place.at, ref: place.ref });
    if (["link", "beam"].includes(this.tool.name) && this.begun.length >= 2 && !more) this.finish();
  }

  finish() {
    const { name } = this.tool, points = this.begun.map(({ at, ref }) => (name === "path" ? at : ref ?? at));
    this.begun = [];
    this.tellHint();
    this.sheet.repaint();
    if (points.length < 2) return;
    if (name === "path") this.bench.act({ kind: "add-path", type: points.length === 2 ? "line" : "polygon", points });
    else if (["link", "beam", "plate"].includes(name)) this.bench.act({ kind: "add-link", points, flexible: name === "beam" });
  }

  // A point of the ground; on a point of a link it holds that.
  async addGround(place) {
    if (place.ref?.startsWith("ground.")) { this.bench.select({ kind: "point", name: place.ref }); return; }
    const found = await this.bench.act({ kind: "add-ground", at: place.at });
    if (found && place.ref) await this.bench.act({ kind: "add-joint", type: "revolute", a: found.selected, b: place.ref });
  }

  // The ref of a place: a point that is there, or a new one on the link below it.
  async refOf(place) {
    if (place.ref && !place.ref.startsWith("ground.")) return place.ref;
    const other = this.refsAt(place.at).find((one) => !one.startsWith("ground."));
    if (other || place.ref) return other ?? null;
    const under = this.sheet.hitBody(...this.pointer ?? place.px);
    if (!under) return null;
    const before = new Set(this.sheet.shown.points.map(([ref]) => ref));
    if (!await this.bench.act({ kind: "add-point", body: under.name, at: place.at })) return null;
    return this.bench.state.picture?.points.map(([ref]) => ref).find((ref) => !before.has(ref)) ?? null;
  }

  async addPoint(place) {
    if (place.ref) this.bench.say("There is a point already.", "error");
    else if (!await this.refOf(place)) this.missed("on a link");
  }

  async setEffector(place) {
    const at = await this.refOf(place);
    if (at) this.bench.act({ kind: "set-effector", at });
    else this.missed("a point of a link, or the link where the point shall be");
  }

  missed(what) { if (this.bench.message.dataset.kind !== "error") this.bench.say(`Nothing there: click ${what}.`, "error"); }

  onPoint(place, kind, what) {
    const ref = this.refsAt(place.at).find((one) => !one.startsWith("ground."));
    if (ref) this.bench.act({ kind, at: ref });
    else this.missed(what);
  }

  onJoint(place, kind) {
    const [joint] = this.jointsAt(place.at);
    if (joint) this.bench.act({ kind, joint });
    else this.missed("a joint");
  }

  twoJoints(place) {
    const [joint] = this.jointsAt(place.at);
    if (!joint) { this.missed("a joint"); return; }
    this.begun.push({ at: place.at, ref: place.ref, joint });
    if (this.begun.length < 2) return;
    const joints = this.begun.splice(0).map((one) => one.joint);
    this.bench.act({ kind: "add-gear", joints, ratio: -1 });
  }

  atJointOrPoints(place, kind, drawn) {
    const [joint] = this.jointsAt(place.at);
    if (joint && !this.begun.length && !drawn) { this.bench.act({ kind, joint }); return; }
    if (!place.ref) { this.missed("a joint or a point"); return; }
    this.begun.push({ at: place.at, ref: place.ref });
    if (this.begun.length === 2) this.bench.act({ kind, points: this.begun.splice(0).map((one) => one.ref) });
  }

  joinPoints(place, type) {
    if (!place.ref) { this.missed("a point of a link or of the ground"); return; }
    const refs = this.refsAt(place.at), bodies = new Set(refs.map((one) => one.split(".")[0]));
    if (!this.begun.length && bodies.size > 1 && this.jointsAt(place.at).length < bodies.size - 1) {
      this.bench.act({ kind: "add-joint", type, a: refs[0], b: refs.at(-1) });
      return;
    }
    this.begun.push({ at: place.at, ref: place.ref });
    if (this.begun.length < 2) return;
    const [a, b] = this.begun.splice(0).map((one) => one.ref);
    this.bench.act({ kind: "add-joint", type, a, b });
  }

  addSlider(place, direction) {
    const ref = this.refsAt(place.at).find((one) => !one.startsWith("ground.")) ?? place.ref;
    this.bench.act({ kind: "add-slider", at: ref ?? place.at, direction });
  }

  direction(start, event) {
    const [px, py] = this.pointer, angle = Math.atan2(start.px[1] - py, px - start.px[0]);
    return event.altKey ? angle : Math.round(angle / TURN) * TURN;
  }

  force(start) {
    const [px, py] = this.pointer;
    return [Math.round((px - start.px[0]) * FORCE), Math.round((start.px[1] - py) * FORCE)];
  }

  async addLoad(place, force) {
    const at = await this.refOf(place);
    if (at) this.bench.act({ kind: "add-load", at, force });
    else this.missed("a point of a link");
  }

  addSensor(place) {
    const [joint] = this.jointsAt(place.at), ref = this.refsAt(place.at).find((one) => !one.startsWith("ground."));
    const under = this.sheet.hitBody(...this.pointer ?? place.px);
    if (joint) this.bench.act({ kind: "add-sensor", joint });
    else if (ref) this.bench.act({ kind: "add-sensor", at: ref });
    else if (under) this.bench.act({ kind: "add-sensor", body: under.name });
    else this.missed("a joint, a point or a link");
  }

  // What is painted over the mechanism: rubber bands, rings where a click snaps, the box of a selection.

  paint(pen) {
    pen.lineWidth = 1.6;
    pen.strokeStyle = pen.fillStyle = this.sheet.colour("accent");
    const { held, hover } = this;
    if (held?.box && held.far) this.paintBox(pen, held.from, held.box);
    if (this.tool.name === "shape") this.paintShape(pen);
    else if (this.isDrawing || this.picking) this.paintDrawing(pen);
    else if (this.under && !held && hover) this.paintUnder(pen);
  }

  paintBox(pen, [ax, ay], [bx, by]) {
    pen.setLineDash([5, 4]);
    pen.strokeRect(Math.min(ax, bx), Math.min(ay, by), Math.abs(bx - ax), Math.abs(by - ay));
    pen.globalAlpha = 0.1;
    pen.fillRect(Math.min(ax, bx), Math.min(ay, by), Math.abs(bx - ax), Math.abs(by - ay));
  }

  paintUnder(pen) {
    if (this.under.kind === "body") return;
    pen.globalAlpha = 0.6;
    this.ring(pen, this.sheet.px(...this.under.at), 10);
  }

  ring(pen, [px, py], size) { pen.beginPath(); pen.arc(px, py, size, 0, 2 * Math.PI); pen.stroke(); }

  paintDrawing(pen) {
    const { hover, held } = this, { name } = this.tool;
    const places = this.picking ? this.picking.places.map((at) => ({ at })) : this.begun;
    const ends = places.map(({ at }) => this.sheet.px(...at));
    if (held?.far && !ends.length && !["ground", "point", "lump", "motor", "drive", "sensor", "effector"].includes(name)) ends.push(held.start.px);
    for (const end of ends) { pen.beginPath(); pen.arc(...end, 4, 0, 7); pen.fill(); }
    if (!hover) return;
    const aim = held?.far && ["slider", "load"].includes(name) ? this.pointer : hover.px;
    if (ends.length) this.paintBand(pen, ends, aim);
    if (hover.ref) this.ring(pen, hover.px, 10);
    else { pen.beginPath(); pen.moveTo(hover.px[0] - 6, hover.px[1]); pen.lineTo(hover.px[0] + 6, hover.px[1]); pen.moveTo(hover.px[0], hover.px[1] - 6); pen.lineTo(hover.px[0], hover.px[1] + 6); pen.stroke(); }
  }

  paintBand(pen, ends, [px, py]) {
    const [ax, ay] = ends.at(-1), { name } = this.tool;
    let far = Math.hypot(px - ax, py - ay), angle = Math.atan2(ay - py, px - ax);
    if (name === "slider") angle = this.direction({ px: [ax, ay] }, {});
    pen.lineWidth = name === "beam" ? 3 : 2;
    pen.setLineDash(name === "path" || this.picking ? [6, 4] : []);
    pen.beginPath();
    ends.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    if (name === "slider") { const [dx, dy] = [2000 * Math.cos(angle), -2000 * Math.sin(angle)]; pen.moveTo(ax - dx, ay - dy); pen.lineTo(ax + dx, ay + dy); } else pen.lineTo(px, py);
    pen.stroke();
    pen.setLineDash([]);
    if (far < 12) return;
    let text = `${quantity(far / this.sheet.scale, "m", 4)}  ${degrees(angle, 3)}`;
    if (name === "slider") text = degrees(angle, 3);
    if (name === "load") text = quantity(Math.hypot(...this.force({ px: [ax, ay] })), "N");
    this.paintLabel(pen, text, (ax + px) / 2, (ay + py) / 2, angle);
  }

  paintLabel(pen, text, x, y, angle) {
    pen.font = "600 12.5px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.textAlign = "center";
    const wide = pen.measureText(text).width / 2 + 6, s = Math.sin(angle), c = Math.cos(angle), up = c < 0 ? 1 : -1;
    const off = wide * Math.abs(s) + 10 * Math.abs(c) + 8, cx = x + up * off * s, cy = y + up * off * c;
    pen.globalAlpha = 0.92; pen.fillStyle = this.sheet.colour("card"); pen.fillRect(cx - wide, cy - 10, 2 * wide, 20);
    pen.globalAlpha = 1; pen.fillStyle = this.sheet.colour("accent"); pen.fillText(text, cx, cy + 0.5);
  }

  // Points that can be moved, and the links as they will be.
  paintShape(pen) {
    const { held, hover } = this, { shown } = this.sheet;
    if (!shown) return;
    pen.globalAlpha = 0.55;
    for (const [, x, y] of shown.points) { const [px, py] = this.sheet.px(x, y); pen.strokeRect(px - 5, py - 5, 10, 10); }
    pen.globalAlpha = 1;
    if (!held?.ref || !held.far || !hover) { if (hover?.ref) this.ring(pen, hover.px, 11); return; }
    const from = held.start.at, moving = new Set(this.refsAt(from).map((ref) => ref.split(".")[0]));
    pen.lineWidth = 2; pen.setLineDash([6, 4]);
    for (const [ref, x, y] of shown.points) {
      const [body] = ref.split(".");
      if (body === "ground" || !moving.has(body) || Math.hypot(x - from[0], y - from[1]) < 1e-9) continue;
      const other = this.sheet.px(x, y), [dx, dy] = [hover.px[0] - other[0], other[1] - hover.px[1]];
      pen.beginPath(); pen.moveTo(...other); pen.lineTo(...hover.px); pen.stroke();
      this.paintLabel(pen, quantity(Math.hypot(dx, dy) / this.sheet.scale, "m", 4), (other[0] + hover.px[0]) / 2, (other[1] + hover.px[1]) / 2, Math.atan2(dy, dx));
    }
    pen.setLineDash([]);
    this.ring(pen, hover.px, 9);
  }
}
