import { Chart, modeText, shortNumber, withArrows } from "./curves.js";
import { button, element, quantity } from "./elements.js";
import { Pulling, linearCharts } from "./pulling.js";
import { Recording } from "./recordings.js";

// The dock below the sheet: a turn of the crank, other assemblies, the flexible run, and one slider of time for all.
const PLAY_SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5];
const MAGNIFICATIONS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
// From the smallest stress to the largest: dark is much on a light sheet, bright on a dark one.
const STRESS_COLOURS = { light: ["#7fc4a0", "#3fa0a8", "#3b6fb0", "#6a3d9a", "#7a0177"], dark: ["#4a5aa8", "#2f9c9c", "#58c26b", "#c8dd3c", "#fff07a"] };

export class Motion {
  constructor(bench) {
    this.bench = bench;
    this.sheet = bench.sheet;
    Object.assign(this, { recordings: { turn: null, run: null }, kind: "", index: 0, over: 0, time: 0, playing: false, looping: true, speed: 1, magnify: 1, before: null, charts: [], number: -1, playable: false });
    bench.motion = this;
    this.layOut();
    this.sheet.under.push((pen) => this.paintUnder(pen));
    this.sheet.over.push((pen) => this.paintOver(pen));
    this.sheet.overBody = (name) => this.paintStress(name);
    // A press on the sheet goes to the drawing, not to the film.
    this.sheet.canvas.addEventListener("pointerdown", (event) => { if (this.sheet.picture && event.button === 0 && !bench.tools?.spaceHeld) this.stop(); }, { capture: true });
    bench.link.on("run", (event) => this.ran(event));
    bench.link.on("end", () => this.pause());
    bench.on("state", () => this.changed());
    bench.on("reach", () => this.runOfItself());
    bench.colours.listeners.push(() => { for (const chart of this.charts) chart.paint(); });
  }

  get recording() { return this.recordings[this.kind] ?? null; }
  get film() { return this.recording?.film ?? null; }

  layOut() {
    this.go = button("▶", "Play (Space)", () => this.toggle(), { class: "icon go" });
    this.slider = element("input", { type: "range", min: 0, max: 1000, value: 0, "aria-label": "Time", oninput: () => { this.pause(); this.seek(this.recording.begin + (this.slider.value / 1000) * (this.recording.end - this.recording.begin)); } });
    this.slider.addEventListener("keydown", (event) => { const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key]; if (by) { event.preventDefault(); this.step(event.shiftKey ? 10 * by : by); } });
    this.clock = element("output", { class: "clock" });
    this.pace = element("select", { "aria-label": "Speed", title: "Speed", onchange: () => { this.speed = Number(this.pace.value); } }, ...PLAY_SPEEDS.map((one) => element("option", { value: one }, `${one} ×`)));
    const loop = button("⟲", "Again and again", () => { this.looping = !this.looping; loop.setAttribute("aria-pressed", this.looping); }, { class: "icon", "aria-pressed": "true" });
    this.opener = button("Charts ▴", "Charts and tables of the motion", () => this.open(this.drawer.hidden), { "aria-expanded": "false" });
    this.player = element("div", { class: "player", hidden: true }, this.go, button("‹", "One frame back (←)", () => this.step(-1), { class: "icon" }), button("›", "One frame on (→)", () => this.step(1), { class: "icon" }), this.slider, this.clock, this.pace, loop, this.opener);
    this.auto = element("input", { type: "checkbox", checked: true });
    this.turner = button("↻ Turn the crank", "Turn the crank: a full turn with positions, velocities, accelerations and coupler curves", () => this.turn());
    this.runner = button("▶ Run", "Compute the flexible motion in all modes of the study", () => this.run(true), { class: "main" });
    this.doing = element("span", { class: "doing" });
    this.stopper = button("■ Stop", "Stop the run", () => this.bench.link.ask("cancel").catch(() => null));
    this.bar = element("div", { class: "progress", role: "progressbar", "aria-label": "Progress of the run" }, element("i", {}));
    this.computing = element("span", { class: "computing", hidden: true }, this.bar, this.doing, this.stopper);
    this.chips = withArrows(element("div", { class: "chips", role: "radiogroup", "aria-label": "Motion that is shown" }));
    this.results = element("p", { class: "results" });
    const actions = element("div", { class: "actions" }, this.turner, button("Assemblies", "All ways in which the links can be joined at this place", () => this.showAssemblies()),
      button("Linear", "Poles and frequency responses about this pose", () => this.showLinear()), new Pulling(this.bench).opener, this.runner,
      element("label", { class: "auto", title: "Run after each change" }, this.auto, "auto"), this.computing);
    this.tools = this.makeTools();
    this.news = element("p", { class: "news" });
    this.drawer = this.makeDrawer();
    this.bench.parts.dock.append(this.drawer, this.player, this.tools, actions, this.results, this.news);
  }

  // Magnification and colours of stress, shown where links bend.
  makeTools() {
    this.magnifier = element("input", { type: "range", min: 0, max: 100, value: 0, "aria-label": "Magnification of deflections", oninput: () => this.setMagnify(MAGNIFICATIONS.at(-1) ** (this.magnifier.value / 100)) });
    this.magnified = element("output", {});
    this.stressed = element("input", { type: "checkbox", checked: true, onchange: () => this.sheet.repaint() });
    this.ghosted = element("input", { type: "checkbox", checked: true, onchange: () => { this.fill(); this.sheet.repaint(); } });
    this.hasGhost = element("label", { hidden: true }, this.ghosted, "run before");
    this.hasStress = element("label", {}, this.stressed, "stress");
    this.hasMagnify = element("label", {}, "deflections ×", this.magnifier, this.magnified);
    return element("div", { class: "showing", hidden: true }, this.chips, this.hasMagnify, this.hasStress, this.hasGhost);
  }

  makeDrawer() {
    this.tabs = withArrows(element("div", { class: "drawer-tabs", role: "tablist", "aria-label": "Charts" }));
    this.overs = element("select", { "aria-label": "Abscissa of the charts", onchange: () => { this.over = Number(this.overs.value); for (const chart of this.charts) chart.paint(); } });
    this.hasOver = element("label", { class: "over" }, "over", this.overs);
    this.plots = element("div", { class: "plots" });
    const bar = element("div", { class: "drawer-bar" }, this.tabs, element("span", { class: "gap" }), this.hasOver, button("×", "Close the charts", () => this.open(false), { class: "icon" }));
    const grip = element("div", { class: "grip", role: "separator", "aria-orientation": "horizontal", "aria-label": "Height of the charts" });
    grip.addEventListener("pointerdown", (event) => grip.setPointerCapture(event.pointerId));
    grip.addEventListener("pointermove", (event) => { if (grip.hasPointerCapture(event.pointerId)) this.drawer.style.height = `${Math.max(150, Math.min(this.drawer.getBoundingClientRect().bottom - event.clientY, innerHeight - 320))}px`; });
    return element("div", { class: "drawer", hidden: true }, grip, bar, this.plots);
  }

  open(on) {
    this.drawer.hidden = !on;
    this.opener.setAttribute("aria-expanded", on);
    this.opener.textContent = on ? "Charts ▾" : "Charts ▴";
    if (on) for (const chart of this.charts) chart.paint();
  }

  // Time.

  seek(time) {
    if (!this.recording) return;
    this.time = Math.min(Math.max(time, this.recording.begin), this.recording.end);
    this.show();
  }

  toggle() { if (this.recording) { if (this.playing) this.pause(); else this.play(); } }

  play() {
    if (!this.recording) return;
    if (this.time >= this.recording.end) this.time = this.recording.begin;
    this.playing = true;
    this.last = performance.now();
    this.mark();
    const tick = (now) => {
      if (!this.playing || !this.recording) return;
      const { begin, end } = this.recording, next = this.time + (this.speed * Math.min(now - this.last, 100)) / 1000;
      this.last = now;
      if (next > end && !this.looping) { this.pause(); this.seek(end); return; }
      this.seek(next > end ? begin : next);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() { this.playing = false; this.mark(); }

  // Back to the drawing.
  stop() {
    this.pause();
    if (!this.sheet.picture) return;
    this.sheet.picture = null;
    this.sheet.repaint();
  }

  step(frames) {
    if (!this.recording) return;
    this.pause();
    const { times } = this.recording, [before, share] = between(times, this.time), now = before + share;
    this.seek(times[Math.min(Math.max(frames > 0 ? Math.floor(now + 1e-6) + frames : Math.ceil(now - 1e-6) + frames, 0), times.length - 1)]);
  }

  mark() {
    this.go.textContent = this.playing ? "❚❚" : "▶";
    for (const name of ["title", "aria-label"]) this.go.setAttribute(name, this.playing ? "Pause (Space)" : "Play (Space)");
  }

  setMagnify(value) {
    this.magnify = value < 10 ? +value.toPrecision(2) : Math.round(value);
    this.magnified.textContent = this.magnify;
    this.magnifier.value = (100 * Math.log(this.magnify)) / Math.log(MAGNIFICATIONS.at(-1));
    this.magnifier.setAttribute("aria-valuetext", `${this.magnify} times`);
    if (this.recording) this.show();
  }

  // The instant on the sheet, in the charts and beside the slider.
  show() {
    const { recording, film, time } = this;
    if (film) this.sheet.picture = film.picture(this.index, time, this.magnify, this.bench.state.picture?.effector);
    this.slider.value = (1000 * (time - recording.begin)) / (recording.end - recording.begin);
    const text = this.clockText();
    this.clock.textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
    if (!this.drawer.hidden) for (const chart of this.charts) chart.paintFront();
    this.sheet.repaint();
  }

  clockText() {
    const { page } = this.recording, over = this.kind === "turn" ? page.abscissae[0] : null;
    if (!over) return `t = ${this.time.toFixed(this.recording.end < 20 ? 3 : 2)} s`;
    const [before, share] = between(page.rows[page.time], this.time), row = page.rows[over.rows[0]], value = row[before] + share * ((row[before + 1] ?? row[before]) - row[before]);
    return `${over.name} = ${over.label.endsWith("[rad]") ? `${(value * 180 / Math.PI).toFixed(1)}°` : quantity(value, "m")}`;
  }

  // Motions.

  take(recording, { play = true } = {}) {
    this.recordings[recording.kind] = recording;
    this.choose(recording.kind, this.kind === recording.kind ? this.index : -1, play);
    // The space bar then pauses, and does not press the same button again.
    if ([this.runner, this.turner, document.body].includes(document.activeElement)) this.go.focus({ preventScroll: true });
  }

  // Show a motion: the turn, or a run by its number (-1 for that of the chosen mode).
  choose(kind, run = -1, play = true) {
    const before = this.recording, fresh = kind !== this.kind || this.shown !== this.recordings[kind];
    this.kind = kind;
    const { recording } = this;
    this.shown = recording;
    const wished = recording.runs.indexOf(this.bench.state.mode ?? "");
    this.index = run >= 0 && run < recording.runs.length ? run : wished >= 0 ? wished : recording.page.selected ?? 0;
    if (fresh) this.begin(recording, before);
    this.player.hidden = false;
    this.fillChips();
    this.fill();
    this.showResults();
    if (fresh && this.film && this.sheet.fitting && play) { this.show(); this.sheet.fit(); }
    if (play) { if (!this.playing) this.play(); } else if (this.sheet.picture || !fresh) this.show();
  }

  // What is new with a motion: its time, speed, magnification and abscissa.
  begin(recording, before) {
    const nearest = PLAY_SPEEDS.reduce((a, b) => (Math.abs(Math.log((b * 5) / (recording.end - recording.begin))) < Math.abs(Math.log((a * 5) / (recording.end - recording.begin))) ? b : a));
    if (before?.kind !== recording.kind) {
      this.pace.value = this.speed = nearest;
      this.over = recording.page.over ?? 0;
      this.setMagnifyOf(recording);
    }
    if (!(this.time >= recording.begin && this.time <= recording.end) || before?.kind !== recording.kind) this.time = recording.begin;
    this.overs.replaceChildren(...["time", ...recording.page.abscissae.map((one) => one.name)].map((name, k) => element("option", { value: k }, name)));
    this.over = Math.min(this.over, recording.page.abscissae.length);
    this.overs.value = this.over;
    this.hasOver.hidden = !recording.page.abscissae.length;
  }

  setMagnifyOf({ film }) {
    this.magnify = 1;
    const least = MAGNIFICATIONS.find((one) => one >= (film?.magnify ?? 1)) ?? 1;
    this.recording && film ? this.setMagnify(film.bends ? least : 1) : null;
  }

  // The mode of the pose was chosen: its run is shown.
  chooseMode(name) {
    const { run } = this.recordings, index = run ? run.runs.indexOf(name) : -1;
    if (this.kind === "run" && index >= 0) this.choose("run", index, this.playing);
  }

  fillChips() {
    const { turn, run } = this.recordings, chips = [];
    if (turn && run) chips.push(["turn", 0, "turn"]);
    if (run) run.runs.forEach((name, k) => { if (turn || run.runs.length > 1) chips.push(["run", k, name || "run"]); });
    this.chips.replaceChildren(...chips.map(([kind, k, name]) => {
      const error = kind === "run" && run.found.errors?.find((one) => one.mode === run.runs[k]);
      return element("button", { type: "button", role: "radio", "aria-checked": String(this.kind === kind && this.index === k), title: error?.text ?? `Show ${name}`, "data-failed": String(!!error), onclick: () => this.choose(kind, k, this.playing) }, modeText(name));
    }));
    this.tools.hidden = !chips.length && this.kind === "turn";
    this.hasMagnify.hidden = !this.film?.bends;
    this.hasStress.hidden = !this.recording.stress;
    this.hasGhost.hidden = !this.before;
  }

  // Main numbers of the shown run, and what was found.
  showResults() {
    const { recording } = this, one = recording.numbers[this.index], parts = [];
    if (one) {
      if (one.status && one.status !== "complete" && one.status !== "done") parts.push(one.status);
      if (one.error_rms !== null && one.error_rms !== undefined) parts.push(`tracking error ${quantity(one.error_rms, "m")}`);
      if (one.stress_max) parts.push(`largest stress ${quantity(one.stress_max, "Pa")}${one.stress_body ? ` in ${one.stress_body}` : ""}`);
      if (one.safety_factor) parts.push(`safety ${shortNumber(one.safety_factor, 3)}`);
      const torques = Object.entries(one.peak_torque ?? {}).filter(([, value]) => value);
      if (torques.length) parts.push(`peak torque ${torques.map(([motor, value]) => `${motor} ${quantity(value, "N m")}`).join(", ")}`);
    }
    this.results.textContent = parts.join(" · ");
    const failed = recording.found.errors?.find((each) => each.mode === recording.runs[this.index]);
    const lines = [...(failed ? [failed.text] : []), ...recording.findings, recording.found.note, recording.found.loads_problem && this.kind === "turn" ? `no torques: ${recording.found.loads_problem}` : ""].filter(Boolean);
    this.tell(lines, failed || recording.found.verdict === "wrong" ? "error" : "note");
  }

  tell(lines, kind = "note") {
    this.news.dataset.kind = kind;
    this.news.title = lines.join("\n");
    this.news.textContent = lines.length > 1 ? `${lines[0]}  (and ${lines.length - 1} more)` : lines[0] ?? "";
  }

  // Charts of the panel that is open; charts that stay are drawn anew, so that what was chosen in them stays.
  fill() {
    const { recording } = this;
    if (!recording) return;
    const panels = [...recording.page.panels, ...(recording.tables.length ? [{ title: "Features", tables: recording.tables }] : [])];
    if (!panels.some(({ title }) => title === this.panel)) this.panel = panels[0]?.title;
    this.tabs.replaceChildren(...panels.map(({ title }) => element("button", { type: "button", role: "tab", "aria-selected": String(title === this.panel), onclick: () => { this.panel = title; this.fill(); } }, title)));
    const { charts = [], tables } = panels.find(({ title }) => title === this.panel) ?? {}, old = new Map(this.charts.map((chart) => [chart.description.identity, chart]));
    this.charts = charts.map((description) => {
      const before = this.beforeOf(description), kept = old.get(description.identity);
      if (!kept) return Object.assign(new Chart(this.bench, this, description, recording.page), { before });
      kept.renew(description, recording.page, before);
      return kept;
    });
    this.plots.replaceChildren(...(tables ? [...this.tiles(), ...tables.map(tableOf)] : this.charts.map((chart) => chart.figure)));
    for (const chart of this.charts) chart.paint();
  }

  beforeOf({ identity }) {
    if (!this.before || this.kind !== "run" || !this.ghosted.checked) return null;
    const description = this.before.page.panels.flatMap((panel) => panel.charts).find((one) => one.identity === identity);
    return description ? { description, page: this.before.page } : null;
  }

  tiles() { return [element("div", { class: "tiles" }, ...(this.recording.found.tiles ?? []).map(([name, value, of]) => element("div", {}, element("span", {}, name), element("b", {}, value), element("small", {}, of))))]; }

  // Requests.

  // A change of the file: what was computed is of the model before; the next run may begin by itself.
  changed() {
    const { text } = this.bench.state, first = this.text === undefined;
    if (text === this.text) return;
    this.text = text;
    this.turner.disabled = this.runner.disabled = !this.bench.state.picture;
    if (first) return;
    this.stop();
    this.computing.hidden = true;
    this.bench.parts.dock.classList.toggle("old", !!this.recording);
    this.due = true;
  }

  // The run after a change, once it is known whether it can be made.
  runOfItself() {
    if (!this.due) return;
    this.due = false;
    if (this.auto.checked && this.bench.state.ready?.ok) this.run(false);
    else if (this.number >= 0) this.bench.link.ask("cancel").catch(() => null);
  }

  async turn() {
    if (this.recordings.turn?.text === this.bench.state.text && this.kind !== "turn") { this.choose("turn"); return; }
    const { text } = this.bench.state, joint = this.bench.selected.find(({ kind }) => kind === "joint")?.name;
    this.turner.disabled = true;
    const found = await this.ask("turn", joint ? { drive: joint } : {});
    this.turner.disabled = false;
    if (!found) return;
    this.take(await Recording.ofTurn(found, text));
    this.settled();
    this.open(true);
  }

  // Compute the flexible motion; `asked` if a person waits for it.
  async run(asked = true) {
    this.asked = asked;
    this.progress("begins", 0);
    const found = await (asked ? this.ask("run") : this.bench.link.ask("run").catch(() => null));
    if (!found) this.computing.hidden = true;
    else this.number = Math.max(this.number, found.run ?? 0);
  }

  progress(text, share) {
    this.computing.hidden = false;
    this.doing.textContent = text;
    this.bar.firstChild.style.width = `${Math.round(100 * share)}%`;
    this.bar.title = `${text} ${Math.round(100 * share)} %`;
    this.bar.setAttribute("aria-valuenow", Math.round(100 * share));
    this.runner.textContent = "▶ Run";
  }

  async ran(event) {
    if (event.run < this.number) return;
    const newer = event.run > this.number || this.of !== event.run;
    this.number = event.run;
    if (event.state === "running") { this.progress(event.doing, event.share ?? 0); return; }
    if (event.state === "cancelled") { this.computing.hidden = true; return; }
    if (event.state === "error") { this.computing.hidden = true; this.tell([event.text], "error"); if (this.asked) this.bench.say(event.text, "error"); return; }
    const { text } = this.bench.state, recording = await Recording.ofRun(event, text);
    if (event.run !== this.number || text !== this.bench.state.text) return;
    if (newer && this.recordings.run && this.recordings.run.text !== text) this.before = this.recordings.run;
    this.of = event.run;
    if (event.state === "done") this.computing.hidden = true;
    const { tools } = this.bench, free = this.asked || (!tools.held && tools.tool.name === "select" && !(this.kind === "turn" && this.playing));
    if (free) this.take(recording, { play: this.playing || event.state === "preview" || newer });
    else { this.recordings.run = recording; if (this.kind !== "turn") this.choose("run", this.kind ? this.index : -1, false); else this.fillChips(); }
    this.settled();
  }

  settled() { this.bench.parts.dock.classList.toggle("old", this.recording?.text !== this.bench.state.text); }

  // Assemblies as small pictures; a click takes one.
  async showAssemblies() {
    const found = await this.ask("assemblies");
    if (!found) return;
    const cards = element("div", { class: "cards" }), dialog = this.bench.dialog("Assemblies", element("p", { class: "soft" }, found.assemblies.length === 1 ? "There is only this way to join the links here." : `${found.assemblies.length} ways to join the links here; the file keeps one with “Keep this pose”.`), cards);
    dialog.classList.add("wide");
    found.assemblies.forEach(({ name, picture }, number) => {
      const paper = element("canvas", { "aria-hidden": "true" });
      cards.append(element("button", { type: "button", class: "card", onclick: () => { dialog.close(); this.takeAssembly(number); } }, paper, element("strong", {}, name || `Assembly ${number + 1}`)));
      paintSmall(paper, picture, this.bench.colours);
    });
  }

  async takeAssembly(number) {
    const found = await this.ask("assembly", { number });
    if (!found) return;
    this.stop();
    this.bench.tools.dragging.posed.hidden = false;
    this.bench.tools.dragging.dragged(found);
  }

  async showLinear() {
    const found = await this.ask("linear");
    if (!found?.poles) return;
    const { charts, table } = linearCharts(this.bench, found), holder = element("div", { class: "plots" }, ...charts.map((chart) => chart.figure), tableOf(table));
    this.bench.dialog(`Linear model about this pose${this.bench.state.mode ? `, mode ${modeText(this.bench.state.mode)}` : ""}`, holder).classList.add("wide");
  }

  // A request whose reply is shown here and not in the message line, but for its refusal.
  async ask(what, fields = {}) {
    this.bench.say("");
    try { return await this.bench.link.ask(what, fields); } catch (error) { this.bench.say(error.text ?? String(error), "error"); return null; }
  }

  // What is painted on the sheet.

  get isPlayed() { return !!this.sheet.picture && !!this.recording; }

  paintUnder(pen) {
    if (!this.isPlayed) return;
    const { film, sheet } = this;
    pen.lineJoin = pen.lineCap = "round";
    if (this.kind === "run" && this.before?.film && this.ghosted.checked) {
      const run = this.before.runs.indexOf(this.recording.runs[this.index]);
      if (run >= 0) this.ghost(pen, this.before.film.lines(this.before.film.stations(run, Math.min(this.time, this.before.end), this.magnify)), 0.55, 3);
    }
    if (film?.bends && this.magnify > 1) this.ghost(pen, film.lines(film.stations(this.index, this.time, 0)), 0.6, 1.2, [3, 4]);
    if (film?.path) this.paintDesired(pen, film.path);
    for (const { path } of this.recording.trails) { pen.strokeStyle = sheet.colour("trail"); pen.globalAlpha = 0.45; pen.lineWidth = 1.6; sheet.trace(path); pen.stroke(); }
  }

  ghost(pen, bodies, alpha, wide, dashes = []) {
    pen.strokeStyle = this.sheet.colour("soft"); pen.globalAlpha = alpha; pen.lineWidth = wide; pen.setLineDash(dashes);
    for (const [, points] of bodies) { this.sheet.trace(points); pen.stroke(); }
    pen.setLineDash([]); pen.globalAlpha = 1;
  }

  paintDesired(pen, { values, runs }) {
    const long = values.length / runs, from = runs > 1 ? this.index * long : 0, points = [];
    for (let k = from; k < from + long; k += 2) points.push(Number.isFinite(values[k]) ? [values[k], values[k + 1]] : null);
    pen.strokeStyle = this.sheet.colour("desired"); pen.lineWidth = 1.4; pen.setLineDash([6, 5]); this.sheet.trace(points); pen.stroke(); pen.setLineDash([]);
  }

  paintOver(pen) {
    if (!this.isPlayed) return;
    const { film, sheet } = this;
    pen.strokeStyle = sheet.colour("trail"); pen.lineWidth = 2.2; pen.lineJoin = "round";
    if (!this.recording.trails.length) for (const tip of film?.tips[this.index] ?? []) { sheet.trace(film.trail(this.index, tip, this.time, this.magnify)); pen.stroke(); }
    const page = this.recording.page, times = page.rows[page.time];
    for (const { path, cusps, crunodes } of this.recording.trails) {
      const [before] = between(times, this.time);
      pen.lineWidth = 2.4; sheet.trace(path.slice(0, before + 1)); pen.stroke();
      for (const one of cusps) this.special(pen, one.position, "cusp");
      for (const one of crunodes) this.special(pen, one.position, "crunode");
    }
    const stopped = film?.stopped(this.index);
    if (stopped !== null && stopped !== undefined && this.time > stopped) { pen.fillStyle = sheet.colour("mark"); pen.font = "600 13px system-ui, sans-serif"; pen.fillText(`this run ended at ${stopped.toFixed(3)} s`, 14, 24); }
    if (this.coloursStress) this.paintScaleOfStress(pen);
  }

  // Special points of coupler curves with their kinds.
  special(pen, [x, y], kind) {
    const { sheet } = this, [px, py] = sheet.px(x, y);
    pen.lineWidth = 2; pen.strokeStyle = pen.fillStyle = sheet.colour("mark");
    pen.beginPath();
    if (kind === "cusp") { pen.moveTo(px, py - 7); pen.lineTo(px + 6, py + 5); pen.lineTo(px - 6, py + 5); pen.closePath(); } else pen.arc(px, py, 6, 0, 7);
    pen.stroke();
    pen.font = "600 11.5px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.lineWidth = 4; pen.strokeStyle = sheet.colour("card");
    pen.strokeText(kind, px + 11, py); pen.fillText(kind, px + 11, py);
  }

  get coloursStress() { return this.isPlayed && this.kind === "run" && this.recording.stress?.largest[this.index] > 0 && this.stressed.checked; }

  stressColour(share) {
    const stops = STRESS_COLOURS[this.bench.colours.isDark ? "dark" : "light"], at = Math.max(0, Math.min(1, share)) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
    const mix = [1, 3, 5].map((from) => { const [a, b] = [stops[k], stops[k + 1]].map((stop) => parseInt(stop.slice(from, from + 2), 16)); return Math.round(a + (at - k) * (b - a)); });
    return `rgb(${mix.join(" ")})`;
  }

  // The links by stress, station by station, over their own colour.
  paintStress(name) {
    if (!this.coloursStress) return;
    const { sheet: { pen }, film } = this, body = film.bodies.find(([one]) => one === name);
    if (!body) return;
    if (this.stressTime !== this.time || this.stressRun !== this.index) { this.shares = this.recording.stressAt(this.index, this.time); [this.stressTime, this.stressRun] = [this.time, this.index]; }
    const [, from, to] = body, points = this.sheet.picture.bodies.find(([one]) => one === name)[1];
    pen.lineWidth = 5;
    for (let k = from + 1; k < to; k++) {
      const share = (this.shares[k - 1] + this.shares[k]) / 2, [a, b] = [points[k - 1 - from], points[k - from]];
      if (!Number.isFinite(share) || !a || !b) continue;
      pen.strokeStyle = this.stressColour(share);
      pen.beginPath(); pen.moveTo(...this.sheet.px(...a)); pen.lineTo(...this.sheet.px(...b)); pen.stroke();
    }
  }

  paintScaleOfStress(pen) {
    const { sheet } = this, wide = 150, x = sheet.width - wide - 16, y = sheet.height - 26;
    for (let k = 0; k < wide; k++) { pen.fillStyle = this.stressColour(k / (wide - 1)); pen.fillRect(x + k, y, 1.5, 8); }
    pen.fillStyle = sheet.colour("soft"); pen.font = "12px system-ui, sans-serif"; pen.textBaseline = "bottom"; pen.textAlign = "left"; pen.fillText("0", x, y - 3);
    pen.textAlign = "right"; pen.fillText(`stress ${quantity(this.recording.stress.largest[this.index], "Pa")}`, x + wide, y - 3);
    pen.textAlign = "left";
  }
}

function tableOf({ title, heads, rows, note }) {
  const head = element("tr", {}, ...heads.map(([name, unit]) => element("th", { scope: "col" }, name, unit ? element("small", {}, ` ${unit}`) : "")));
  const body = rows.map((row) => element("tr", {}, ...row.map((cell, k) => element(k ? "td" : "th", k ? {} : { scope: "row" }, cell))));
  return element("section", { class: "table" }, element("h3", {}, title), element("div", { class: "scroll", tabindex: "0" }, element("table", {}, element("thead", {}, head), element("tbody", {}, ...body))), note ? element("p", { class: "soft" }, note) : "");
}

// A picture on a small canvas: links alone.
export function paintSmall(paper, picture, colours) {
  const [wide, high] = [190, 120], ratio = devicePixelRatio || 1, [x0, y0, x1, y1] = picture.limits, scale = 0.86 * Math.min(wide / (x1 - x0), high / (y1 - y0)), pen = paper.getContext("2d");
  [paper.width, paper.height] = [wide * ratio, high * ratio];
  pen.scale(ratio, ratio);
  const px = ([x, y]) => [wide / 2 + scale * (x - (x0 + x1) / 2), high / 2 - scale * (y - (y0 + y1) / 2)];
  pen.lineJoin = pen.lineCap = "round"; pen.lineWidth = 3;
  picture.bodies.forEach(([, points, plate], k) => {
    pen.strokeStyle = pen.fillStyle = colours.link(k);
    pen.beginPath(); points.filter(Boolean).forEach((one, j) => (j ? pen.lineTo(...px(one)) : pen.moveTo(...px(one)))); pen.stroke();
    if (plate) { pen.globalAlpha = 0.22; pen.fill(); pen.globalAlpha = 1; }
  });
  pen.fillStyle = colours.of("card"); pen.strokeStyle = colours.of("ink"); pen.lineWidth = 1.3;
  for (const [, , x, y] of picture.joints) { pen.beginPath(); pen.arc(...px([x, y]), 3, 0, 7); pen.fill(); pen.stroke(); }
}
