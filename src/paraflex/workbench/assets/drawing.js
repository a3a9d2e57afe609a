const TURN = Math.PI / 12; // step of directions
const FORCE = 0.2; // N/px

// The tools that add something: the points of a link or path as they are clicked, then the action.
export class Drawing {
  constructor(bench, tools) {
    Object.assign(this, { bench, tools, sheet: bench.sheet, places: bench.sheet.places });
    this.begun = []; // ends so far: {at, ref}
  }

  // A press and its release with a tool that draws: a drag has two places, a click one.
  released(held, end, event) {
    const { name } = this.tools.tool, dragged = held.far && !this.sameplace(held.start, end);
    if (name === "slider") this.addSlider(held.start, dragged ? this.direction(held.start, event) : 0);
    else if (name === "load") this.addLoad(held.start, dragged ? this.force(held.start) : [0, -10]);
    else if (name === "point" && dragged) this.addPoint(held.start, end);
    else if (dragged && !this.begun.length && ["link", "beam", "path", "spring", "damper", "revolute", "weld", "gear", "plate"].includes(name)) {
      this.clicked(held.start, event, true);
      this.clicked(end, event, true);
      if (name === "path") this.finish();
    } else this.clicked(end, event);
  }

  sameplace(a, b) { return Math.hypot(a.px[0] - b.px[0], a.px[1] - b.px[1]) < 4; }

  sameAsLast(place) { return this.begun.length > 0 && this.sameplace({ px: this.sheet.px(...this.begun.at(-1).at) }, place); }

  // A click with a tool; `drawn` if it is an end of a drag.
  clicked(place, event, drawn = false) {
    const { name } = this.tools.tool;
    const click = {
      ground: () => this.addGround(place), point: () => this.addPoint(place), lump: () => this.atLink(place, { kind: "add-lump" }, "a point of a flexible link"),
      motor: () => this.onJoint(place, "add-motor"), drive: () => this.onJoint(place, "add-drive"), effector: () => this.atLink(place, { kind: "set-effector" }, "a point of a link, or the link where the point shall be"), sensor: () => this.addSensor(place),
      gear: () => this.twoJoints(place), spring: () => this.atJointOrPoints(place, "add-spring", drawn), damper: () => this.atJointOrPoints(place, "add-damper", drawn),
      revolute: () => this.joinPoints(place, "revolute"), weld: () => this.joinPoints(place, "weld"), slider: () => this.addSlider(place, 0), load: () => this.addLoad(place, [0, -10]),
    }[name];
    if (click) click();
    else this.nextPoint(place, event.shiftKey);
    this.tools.showHint();
  }

  // The next point of a link or path; a link has two unless more are asked for.
  nextPoint(place, more) {
    if (this.sameAsLast(place)) { this.finish(); return; }
    this.begun.push({ at: place.at, ref: place.ref });
    if (["link", "beam"].includes(this.tools.tool.name) && this.begun.length >= 2 && !more) this.finish();
  }

  finish() {
    const { name } = this.tools.tool, points = this.begun.map(({ at, ref }) => (name === "path" ? at : ref ?? at));
    this.begun = [];
    this.tools.showHint();
    this.sheet.repaint();
    if (points.length < 2) return;
    if (name === "path") this.bench.act({ kind: "add-path", type: points.length === 2 ? "line" : "polygon", points });
    else if (["link", "beam", "plate"].includes(name)) this.bench.act({ kind: "add-link", points, flexible: name === "beam" });
  }

  // A point of the ground; on a point of a link it holds that.
  async addGround(place) {
    if (place.ref?.startsWith("ground.")) { this.bench.select({ kind: "point", name: place.ref }); return; }
    const joint = place.ref ? [{ kind: "add-joint", type: "revolute", a: "@", b: place.ref }] : [];
    await this.bench.actAll({ kind: "add-ground", at: place.at }, ...joint);
  }

  // An action at a point of a link; on a link without a point there, one step that adds it as well.
  atLink(place, action, what) {
    const own = (one) => one && !one.startsWith("ground."), ref = own(place.ref) ? place.ref : this.places.refsAt(place.at).find(own);
    const under = !ref && !place.ref && this.sheet.hitBody(...this.tools.pointer ?? place.px);
    if (ref) this.bench.act({ ...action, at: ref });
    else if (under) this.bench.actAll({ kind: "add-point", body: under.name, at: under.foot ?? place.at }, { ...action, at: "@" });
    else this.missed(what);
  }

  // On a link, or beside it where a press on the link is released.
  addPoint(place, end) {
    const under = this.sheet.hitBody(...(end ? place.px : this.tools.pointer ?? place.px));
    if ((end ?? place).ref) this.bench.say("There is a point already.", "error");
    else if (under) this.bench.act({ kind: "add-point", body: under.name, at: end?.at ?? under.foot ?? place.at });
    else this.missed("on a link");
  }

  missed(what) { if (this.bench.message.dataset.kind !== "error") this.bench.say(`Nothing there: click ${what}.`, "error"); }

  onJoint(place, kind) {
    const [joint] = this.places.jointsAt(place.at);
    if (joint) this.bench.act({ kind, joint });
    else this.missed("a joint");
  }

  twoJoints(place) {
    const [joint] = this.places.jointsAt(place.at);
    if (!joint) { this.missed("a joint"); return; }
    this.begun.push({ at: place.at, ref: place.ref, joint });
    if (this.begun.length < 2) return;
    const joints = this.begun.splice(0).map((one) => one.joint);
    this.bench.act({ kind: "add-gear", joints, ratio: -1 });
  }

  atJointOrPoints(place, kind, drawn) {
    const [joint] = this.places.jointsAt(place.at);
    if (joint && !this.begun.length && !drawn) { this.bench.act({ kind, joint }); return; }
    if (!place.ref) { this.missed("a joint or a point"); return; }
    this.begun.push({ at: place.at, ref: place.ref });
    if (this.begun.length === 2) this.bench.act({ kind, points: this.begun.splice(0).map((one) => one.ref) });
  }

  joinPoints(place, type) {
    if (!place.ref) { this.missed("a point of a link or of the ground"); return; }
    const refs = this.places.refsAt(place.at), bodies = new Set(refs.map((one) => one.split(".")[0]));
    const [joint] = this.places.jointsAt(place.at);
    if (!this.begun.length && joint && this.places.jointsAt(place.at).length >= bodies.size - 1) { this.bench.act({ kind: "retype", joint, type }); return; }
    if (!this.begun.length && bodies.size > 1 && this.places.jointsAt(place.at).length < bodies.size - 1) {
      this.bench.act({ kind: "add-joint", type, a: refs[0], b: refs.at(-1) });
      return;
    }
    this.begun.push({ at: place.at, ref: place.ref });
    if (this.begun.length < 2) return;
    const [a, b] = this.begun.splice(0).map((one) => one.ref);
    this.bench.act({ kind: "add-joint", type, a, b });
  }

  // A block on a rail; on a point that lies on another link a slot along that link.
  addSlider(place, direction) {
    const slides = this.places.jointsAt(place.at).some((one) => this.sheet.shown.joints.some(([name, kind]) => name === one && kind === "prismatic"));
    if (slides) { this.bench.say("There is a slider already; its direction is among its properties.", "error"); return; }
    const here = this.places.refsAt(place.at), below = place.ref && !direction && this.sheet.hitBody(...place.px, here.map((one) => one.split(".")[0]));
    const guide = below && this.sheet.shown.points.find(([one, x, y]) => one.startsWith(`${below.name}.`) && Math.hypot(x - place.at[0], y - place.at[1]) > 1e-9);
    if (guide) { this.bench.act({ kind: "add-joint", type: "slot", a: guide[0], b: place.ref }); return; }
    const ref = this.places.refsAt(place.at).find((one) => !one.startsWith("ground.")) ?? place.ref;
    this.bench.act({ kind: "add-slider", at: ref ?? place.at, direction });
  }

  direction(start, event) {
    const [px, py] = this.tools.pointer, angle = Math.atan2(start.px[1] - py, px - start.px[0]);
    return event.altKey ? angle : Math.round(angle / TURN) * TURN;
  }

  force(start) {
    const [px, py] = this.tools.pointer;
    return [Math.round((px - start.px[0]) * FORCE), Math.round((start.px[1] - py) * FORCE)];
  }

  addLoad(place, force) { this.atLink(place, { kind: "add-load", force }, "a point of a link"); }

  addSensor(place) {
    const [joint] = this.places.jointsAt(place.at), ref = this.places.refsAt(place.at).find((one) => !one.startsWith("ground."));
    const under = this.sheet.hitBody(...this.tools.pointer ?? place.px);
    if (joint) this.bench.act({ kind: "add-sensor", joint });
    else if (ref) this.bench.act({ kind: "add-sensor", at: ref });
    else if (under) this.bench.act({ kind: "add-sensor", body: under.name });
    else this.missed("a joint, a point or a link");
  }
}
