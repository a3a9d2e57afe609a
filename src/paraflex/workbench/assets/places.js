const SNAP = 13; // distance [px]

// Places on the sheet: where a pointer snaps, and which points and joints are there.
export class Places {
  constructor(sheet) { this.sheet = sheet; }

  // The place to which a pointer snaps: a point of the mechanism (its ref), or the grid.
  snap(px, py, event, begun = [], near = SNAP) {
    let best = null, least = event.pointerType === "touch" ? 2 * near : near;
    for (const [ref, x, y] of this.sheet.shown?.points ?? []) {
      const [qx, qy] = this.sheet.px(x, y), far = Math.hypot(px - qx, py - qy);
      if (far < least - 1e-6) { least = far; best = { at: [x, y], ref, px: [qx, qy] }; }
    }
    for (const one of begun) {
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
}
