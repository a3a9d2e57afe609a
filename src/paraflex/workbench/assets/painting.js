import { degrees, quantity } from "./elements.js";

// What tools paint over the mechanism: rubber bands, rings where a click snaps, the box of a selection.
export class Painting {
  constructor(bench, tools) {
    Object.assign(this, { tools, sheet: bench.sheet, drawing: tools.drawing });
    bench.sheet.over.push((pen) => this.paint(pen));
  }

  paint(pen) {
    if (this.tools.hover && (this.tools.isDrawing || this.tools.held?.far)) this.paintPlace(pen, this.tools.hover.at);
    pen.lineWidth = 1.6;
    pen.strokeStyle = pen.fillStyle = this.sheet.colour("accent");
    const { held, hover } = this.tools;
    if (held?.box && held.far) this.paintBox(pen, held.from, held.box);
    if (this.tools.tool.name === "shape") this.paintShape(pen);
    else if (this.tools.isDrawing || this.tools.picking) this.paintDrawing(pen);
    else if (this.tools.under && !held && hover) this.paintUnder(pen);
  }

  // Coordinates of the place to which a click snaps.
  paintPlace(pen, at) {
    pen.font = "12px system-ui, sans-serif"; pen.textBaseline = "alphabetic"; pen.fillStyle = this.sheet.colour("soft");
    pen.fillText(at.map((one, k) => `${"xy"[k]} ${quantity(one, "m", 4) || "0"}`).join("   "), 160, this.sheet.height - 14);
  }

  paintBox(pen, [ax, ay], [bx, by]) {
    pen.setLineDash([5, 4]);
    pen.strokeRect(Math.min(ax, bx), Math.min(ay, by), Math.abs(bx - ax), Math.abs(by - ay));
    pen.globalAlpha = 0.1;
    pen.fillRect(Math.min(ax, bx), Math.min(ay, by), Math.abs(bx - ax), Math.abs(by - ay));
  }

  paintUnder(pen) {
    if (this.tools.under.kind === "body") return;
    pen.globalAlpha = 0.6;
    this.ring(pen, this.sheet.px(...this.tools.under.at), 10);
  }

  ring(pen, [px, py], size) { pen.beginPath(); pen.arc(px, py, size, 0, 2 * Math.PI); pen.stroke(); }

  paintDrawing(pen) {
    const { hover, held } = this.tools, { name } = this.tools.tool;
    const places = this.tools.picking ? this.tools.picking.places.map((at) => ({ at })) : this.drawing.begun;
    const ends = places.map(({ at }) => this.sheet.px(...at));
    if (held?.far && !ends.length && !["ground", "point", "lump", "motor", "drive", "sensor", "effector"].includes(name)) ends.push(held.start.px);
    for (const end of ends) { pen.beginPath(); pen.arc(...end, 4, 0, 7); pen.fill(); }
    if (!hover) return;
    const aim = held?.far && ["slider", "load"].includes(name) ? this.tools.pointer : hover.px;
    if (ends.length) this.paintBand(pen, ends, aim);
    if (hover.ref) this.ring(pen, hover.px, 10);
    else { pen.beginPath(); pen.moveTo(hover.px[0] - 6, hover.px[1]); pen.lineTo(hover.px[0] + 6, hover.px[1]); pen.moveTo(hover.px[0], hover.px[1] - 6); pen.lineTo(hover.px[0], hover.px[1] + 6); pen.stroke(); }
  }

  paintBand(pen, ends, [px, py]) {
    const [ax, ay] = ends.at(-1), { name } = this.tools.tool;
    let far = Math.hypot(px - ax, py - ay), angle = Math.atan2(ay - py, px - ax);
    if (name === "slider") angle = this.drawing.direction({ px: [ax, ay] }, {});
    pen.lineWidth = name === "beam" ? 3 : 2;
    pen.setLineDash(name === "path" || this.tools.picking ? [6, 4] : []);
    pen.beginPath();
    ends.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    if (name === "slider") { const [dx, dy] = [2000 * Math.cos(angle), -2000 * Math.sin(angle)]; pen.moveTo(ax - dx, ay - dy); pen.lineTo(ax + dx, ay + dy); } else pen.lineTo(px, py);
    pen.stroke();
    pen.setLineDash([]);
    if (far < 12) return;
    let text = `${quantity(far / this.sheet.scale, "m", 4)}  ${degrees(angle, 3)}`;
    if (name === "slider") text = degrees(angle, 3);
    if (name === "load") text = quantity(Math.hypot(...this.drawing.force({ px: [ax, ay] })), "N");
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
    const { held, hover } = this.tools, { shown } = this.sheet;
    if (!shown) return;
    pen.globalAlpha = 0.55;
    for (const [, x, y] of shown.points) { const [px, py] = this.sheet.px(x, y); pen.strokeRect(px - 5, py - 5, 10, 10); }
    pen.globalAlpha = 1;
    if (!held?.ref || !held.far || !hover) { if (hover?.ref) this.ring(pen, hover.px, 11); return; }
    const from = held.start.at, moving = new Set(this.sheet.places.refsAt(from).map((ref) => ref.split(".")[0]));
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
