import { button, element } from "./elements.js";

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

// Selecting with the pointer, and moving the mechanism with it.
export class Dragging {
  constructor(bench, tools) {
    Object.assign(this, { bench, tools, sheet: bench.sheet });
    this.drag = new Newest(bench, "drag", (found) => this.dragged(found));
    this.badge = element("span", { class: "badge", hidden: true });
    this.posed = element("div", { class: "posed", hidden: true }, element("small", {}, "Runs begin in the pose of the file."),
      button("Keep this pose", "The dragged pose becomes the assembly of the file, in which runs begin", () => bench.request("pose"), { class: "main" }),
      button("Back", "The assembly of the file again", () => this.back()));
    bench.parts.stage.append(this.badge, this.posed);
    bench.on("state", () => { this.posed.hidden = !bench.state.moved; });
  }

  press(px, event, held) {
    const under = this.sheet.hit(...px, event.pointerType === "touch" ? 22 : undefined);
    held.under = under;
    if (!under) { held.box = null; return; }
    held.selected = this.bench.selected.find(({ kind }) => kind === "joint");
    if (!this.bench.isSelected(under.kind, under.name) && !event.shiftKey) this.bench.select(under);
    const ref = under.kind === "body" ? null : this.sheet.places.refsAt(under.at).find((one) => !one.startsWith("ground."));
    const at = under.kind === "body" ? this.sheet.metres(...px) : under.at;
    if (ref && !this.sheet.places.refsAt(under.at).some((one) => one.startsWith("ground."))) held.drags = { point: ref };
    else if (under.kind === "body") held.drags = this.gripOn(under.name, at);
  }

  // A place on a body in its own frame.
  gripOn(body, [x, y]) {
    const frame = this.sheet.shown.frames?.[body];
    if (!frame) return null;
    const [ox, oy, angle] = frame, c = Math.cos(angle), s = Math.sin(angle);
    return { body, local: [c * (x - ox) + s * (y - oy), c * (y - oy) - s * (x - ox)] };
  }

  send(px, held) {
    held.sent = true;
    this.bench.motion?.stop?.();
    this.sheet.canvas.style.cursor = "grabbing";
    this.drag.send({ ...held.drags, to: this.sheet.metres(...px) });
  }

  dragged({ picture, seen, stop, problem }) {
    const { state } = this.bench;
    if (picture) state.picture = picture;
    if (seen) state.seen = { ...state.seen, ...seen };
    const word = problem ? problem.text ?? problem : STOPS[stop] ?? "";
    this.badge.hidden = !word || !this.tools.held;
    this.badge.textContent = word;
    if (this.tools.pointer) this.badge.style.transform = `translate(${Math.min(this.tools.pointer[0] + 16, this.sheet.width - 150)}px, ${this.tools.pointer[1] + 14}px)`;
    this.bench.notify("picture");
  }

  async end(held) {
    this.badge.hidden = true;
    this.sheet.canvas.style.cursor = this.tools.tool.cursor;
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

  release(held, event) {
    if (held.sent) { this.end(held); return; }
    if (held.box) { this.selectBox(held.from, held.box, event.shiftKey); return; }
    if (!held.under) { if (!event.shiftKey) this.bench.select(null); } else if (event.shiftKey) this.bench.select(held.under, true);
    else this.bench.select(this.next(held));
    if (held.under) this.bench.fieldsWanted();
  }

  // What a click selects: of several joints in one place the next one.
  next({ under, selected }) {
    const there = under.kind === "joint" ? this.sheet.places.jointsAt(under.at) : [], at = selected ? there.indexOf(selected.name) : -1;
    return at < 0 ? under : { ...under, name: there[(at + 1) % there.length] };
  }

  selectBox([ax, ay], [bx, by], more) {
    const { shown } = this.sheet;
    if (!shown) return;
    const within = ([x, y]) => { const [px, py] = this.sheet.px(x, y); return (px - ax) * (px - bx) <= 0 && (py - ay) * (py - by) <= 0; };
    const free = new Set(shown.points.map(([ref]) => ref));
    for (const [, , x, y] of shown.joints) for (const ref of this.sheet.places.refsAt([x, y])) free.delete(ref);
    const found = [
      ...shown.bodies.filter(([, points]) => points.filter(Boolean).every(within)).map(([name]) => ({ kind: "body", name })),
      ...shown.joints.filter(([, , x, y]) => within([x, y])).map(([name]) => ({ kind: "joint", name })),
      ...shown.points.filter(([ref, x, y]) => free.has(ref) && within([x, y])).map(([name]) => ({ kind: "point", name })),
    ];
    this.bench.selected = more ? [...this.bench.selected.filter((one) => !found.some((each) => each.kind === one.kind && each.name === one.name)), ...found] : found;
    this.bench.notify("selected");
  }
}
