import { readPage } from "./curves.js";

// Motions that Python has computed, as pictures at any time, with their charts: runs in modes, and turns of a crank.
// The functions inflated, unpacked, between, valuesAt and lastFrame are those of the reports, in unpacking.js.
const JOINT_LOOKS = ["pin", "block", "rod", "weld"];

// A film of Python: bodies and symbols are drawn at base + m (shape - base).
export class Film {
  static async read(described) {
    const film = Object.assign(new Film(), described);
    [film.base, film.bend, film.path] = await Promise.all(["base", "bend", "path"].map((name) => (described[name] ? unpacked(described[name]) : null)));
    film.places = await Promise.all(described.marks.map((sets) => Promise.all((sets ?? []).map((one) => unpacked(one.places)))));
    film.swings = await Promise.all(described.swing.map((one) => (one ? unpacked(one) : null)));
    film.last = described.marks.map((_, run) => lastFrame(film.base, run));
    return film;
  }

  // The frame before a time and the share of the way to the next; a run that stopped stays at its last frame.
  at(run, time) {
    const [before, share] = between(this.time, time), last = this.last[run];
    return before >= last ? [Math.max(last, 0), 0] : [before, share];
  }

  // Time at which a run stopped early; null if it went on to the end.
  stopped(run) { return this.last[run] < this.time.length - 1 ? this.time[Math.max(this.last[run], 0)] : null; }

  // Places of all stations, x and y in turn; with the magnification 0 those of rigid links.
  stations(run, time, magnify) {
    const [before, share] = this.at(run, time), out = valuesAt(this.base, run, before, share);
    if (magnify) { const bend = valuesAt(this.bend, run, before, share); for (let k = 0; k < out.length; k++) out[k] += magnify * bend[k]; }
    return out;
  }

  lines(stations) { return this.bodies.map(([name, from, to, plate]) => [name, pointsOf(stations, from, to), plate]); }

  // Instant of a run as a picture of the sheet.
  picture(run, time, magnify, effector) {
    if (!(this.last[run] >= 0)) return null;
    const [before, share] = this.at(run, time), stations = this.stations(run, time, magnify), marks = [], joints = [], swing = this.swings[run] && valuesAt(this.swings[run], 0, before, share);
    this.marks[run].forEach(({ pieces }, moving) => {
      const places = valuesAt(this.places[run][moving], 0, before, share);
      if (moving && swing) for (let k = 0; k < places.length; k++) places[k] += (magnify - 1) * swing[k];
      for (const [look, name, from, to] of pieces) {
        const points = pointsOf(places, from, to);
        if ((look === "load" || look === "head") && !spread(points, this.dot / 4)) continue;
        marks.push([moving ? "moving" : "still", look, name, points]);
        if (moving && name && JOINT_LOOKS.includes(look) && !joints.some(([one]) => one === name)) joints.push([name, look, ...middle(points), "", ""]);
      }
    });
    const tips = (this.tips[run] ?? []).map((tip, k) => [k ? `tip.${k}` : effector ?? "tip.P", stations[2 * tip], stations[2 * tip + 1]]);
    return { bodies: this.lines(stations), marks, joints, points: tips, effector: tips[0]?.[0] ?? null, lumps: [], open: {}, problems: [], frames: {}, limits: [this.view[0], this.view[1], this.view[2], this.view[3]] };
  }

  // The line of a followed point up to a time.
  trail(run, tip, time, magnify) {
    const [before] = this.at(run, time), out = [];
    for (let frame = 0; frame <= before; frame++) {
      const k = (run * this.base.frames + frame) * this.base.wide + 2 * tip;
      out.push([this.base.values[k] + magnify * this.bend.values[k], this.base.values[k + 1] + magnify * this.bend.values[k + 1]]);
    }
    const now = this.stations(run, time, magnify);
    return [...out, [now[2 * tip], now[2 * tip + 1]]];
  }
}

function pointsOf(values, from, to) {
  const out = [];
  for (let k = from; k < to; k++) out.push(Number.isFinite(values[2 * k]) ? [values[2 * k], values[2 * k + 1]] : null);
  return out;
}

function spread(points, least) { return points.some((one) => one && points[0] && Math.hypot(one[0] - points[0][0], one[1] - points[0][1]) > least); }

function middle(points) {
  const known = points.filter(Boolean), closed = known.length > 2 && Math.hypot(known[0][0] - known.at(-1)[0], known[0][1] - known.at(-1)[1]) < 1e-9 ? known.slice(1) : known;
  return [0, 1].map((axis) => closed.reduce((sum, one) => sum + one[axis], 0) / Math.max(closed.length, 1));
}

// What is played: `kind` is "run" or "turn"; `runs` are the names of modes, "" for a motion without.
export class Recording {
  static async ofRun(found, text) {
    const page = await readPage(found.page), film = page.film ? await Film.read(page.film) : null;
    const stress = found.stress ? stressesOf(found.stress, await inflated(found.stress.data)) : null;
    return Object.assign(new Recording(), { kind: "run", found, text, page, film, stress, trails: [], tables: [], findings: found.findings ?? [], numbers: found.numbers ?? [] });
  }

  static async ofTurn(found, text) {
    const page = pageOfTurn(found), film = found.film ? await Film.read(found.film) : null;
    const findings = (found.findings ?? []).map((one) => one.text ?? String(one));
    return Object.assign(new Recording(), { kind: "turn", found, text, page, film, stress: null, trails: found.trails ?? [], tables: found.tables ?? [], findings, numbers: [] });
  }

  get runs() { return this.page.runs; }
  get times() { const times = this.film?.time ?? this.page.rows[this.page.time] ?? []; return times.length > 1 ? times : [0, 1]; }
  get begin() { return this.times[0]; }
  get end() { return this.times[this.times.length - 1]; }

  // Share of the run's largest stress at each station; NaN where it is not known.
  stressAt(run, time) {
    const { shape: [, frames, stations], bytes, highest } = this.stress, [before, share] = this.film.at(run, time);
    const start = (run * frames + Math.min(before + Math.round(share), frames - 1)) * stations;
    return Array.from(bytes.subarray(start, start + stations), (byte) => (byte === 255 ? NaN : byte / highest[run]));
  }
}

// Stresses in bytes, 255 where none is known, with the largest byte of each run and its stress [Pa].
function stressesOf({ shape, most }, bytes) {
  const long = shape[1] * shape[2], highest = Array.from({ length: shape[0] }, (_, run) => bytes.subarray(run * long, (run + 1) * long).reduce((found, one) => (one < 255 && one > found ? one : found), 1));
  return { shape, bytes, highest, largest: highest.map((one) => (most * one) / 254) };
}

const UNIT_STEPS = [[1e3, "k"], [1, ""], [1e-3, "m"]];
const TYPESET = { "m/s^2": "m/s²", "rad/s^2": "rad/s²" };

// Unit in which values have few digits: its factor and name.
function unitFor(unit, values) {
  const shown = TYPESET[unit] ?? unit;
  if (!/^(m|N)/.test(unit)) return [1, shown];
  const most = values.reduce((found, one) => Math.max(found, Math.abs(one ?? 0)), 0), [size, prefix] = most ? UNIT_STEPS.find(([one]) => most >= one) ?? UNIT_STEPS.at(-1) : [1, ""];
  return [1 / size, `${prefix}${shown}`];
}

// Charts of a turn in the form of a report's page: title, quantities, and whether each thing is shown alone.
const TURN_PANELS = [
  ["Points", [["Position", "position"], ["Velocity", "velocity"], ["Acceleration", "acceleration"]], true],
  ["Joints", [["Transmission angle", "transmission angle"], ["Joints", "joint"], ["Speeds of joints", "joint speed"]], false],
  ["Links", [["Angles", "angle"], ["Angular velocities", "angular velocity"], ["Angular accelerations", "angular acceleration"]], false],
  ["Torques", [["Torques", "torque"], ["Forces", "force"]], false],
];

function pageOfTurn({ time, over, curves }) {
  const rows = [Float64Array.from(time)], page = { rows, time: 0, runs: [""], selected: 0, abscissae: [], panels: [], over: 0 };
  if (over?.joint) {
    page.abscissae.push({ name: over.joint, label: `${over.unit === "rad" ? "angle" : "travel"} of ${over.joint} [${over.unit}]`, rows: [rows.push(Float64Array.from(over.values)) - 1] });
    page.over = 1;
  }
  for (const [title, quantities, alone] of TURN_PANELS) {
    const charts = quantities.flatMap(([name, quantity]) => [...new Set(curves.filter((one) => one.quantity === quantity).map((one) => one.unit))]
      .map((unit) => turnChart(name, curves.filter((one) => one.quantity === quantity && one.unit === unit), alone, rows)));
    if (charts.length) page.panels.push({ title, charts });
  }
  return page;
}

function turnChart(title, curves, alone, rows) {
  const [factor, unit] = unitFor(curves[0].unit, curves.flatMap((one) => one.values)), { quantity } = curves[0], things = [...new Set(curves.map((one) => one.of))], byThing = alone && things.length > 1;
  const named = (one) => (alone ? { x: "x", y: "y", size: "size" }[one.part] ?? one.part : quantity === "transmission angle" && one.part ? `${one.of}, ${one.part}` : one.of);
  const made = curves.map((one, k) => ({
    name: named(one), x: 0, y: rows.push(Float64Array.from(one.values, (value) => (value === null ? NaN : factor * value))) - 1, run: null, shown: null,
    choice: byThing ? things.indexOf(one.of) : null, colour: alone ? { x: 0, y: 1 }[one.part] ?? 2 : k % 8, dash: alone ? { x: 0, y: 1 }[one.part] ?? 3 : [0, 1, 3, 2, 4][k % 5],
  }));
  return {
    identity: `turn-${quantity}-${unit}`, title: byThing || !alone ? title : `${title} of ${things[0]}`, y: [`${quantity} [${unit}]`], x: "time t [s]", curves: made,
    choices: byThing ? things : [], choosing: "point", log: false, log_x: false, equal: false, over_time: true, note: "", layout: {},
  };
}
