// The animation: bodies at base + m (shape - base), symbols, path and trail of the scenes of all runs on a canvas.
const player = (() => {
  const { page, state, element } = report;
  const MAGNIFICATIONS = [1, 2, 5, 10, 20, 50, 100, 200];
  const LARGEST = MAGNIFICATIONS.at(-1);
  // Distances and directions from what is named in which a name is put; more names keep clear of one another only.
  const GAPS = [7, 16, 30, 46], DIRECTIONS = [0.6, 0, -0.6, Math.PI / 2, -Math.PI / 2, Math.PI - 0.6, Math.PI, Math.PI + 0.6];
  const MOST_APART = 60;
  const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5];
  const byId = (name) => document.getElementById(name);
  const canvas = byId("canvas"), pen = canvas.getContext("2d");
  const { film } = page;
  let arrays = null, times = [0], speed = 1, last = 0, width = 0, height = 0, place = null, colours = {}, waiting = false;
  // Where each name was put last.
  const stands = new Map();

  const end = () => times[times.length - 1];
  const named = film && film.moments.length > 0;
  // Frames that are no instants have names: that of the nearest one.
  function momentName(time) {
    const [before, share] = report.between(times, time);
    return film.moments[Math.min(before + Math.round(share), film.moments.length - 1)];
  }
  const secondsText = (time) => (named ? momentName(time) : film && film.periodic ? `${Math.round(360 * time / end())}°` : `${time.toFixed(end() < 20 ? 3 : 2)} s`);

  function seek(time) {
    report.set("time", Math.min(Math.max(Number(time), times[0]), end()));
  }

  function play(on) {
    if (on && state.time >= end()) seek(times[0]);
    report.set("playing", on);
    if (on) { last = performance.now(); requestAnimationFrame(tick); }
  }

  function tick(now) {
    if (!state.playing) return;
    let time = state.time + speed * Math.min(now - last, 100) / 1000;
    last = now;
    if (time > end()) time = times[0];
    seek(time);
    requestAnimationFrame(tick);
  }

  function step(frames) {
    play(false);
    const [before, share] = report.between(times, state.time);
    const now = before + share;
    const next = frames > 0 ? Math.floor(now + 1e-6) + frames : Math.ceil(now - 1e-6) + frames;
    seek(times[Math.min(Math.max(next, 0), times.length - 1)]);
  }

  function magnify(by) {
    const next = by > 0 ? MAGNIFICATIONS.find((m) => m > state.magnify * 1.001) : MAGNIFICATIONS.findLast((m) => m < state.magnify * 0.999);
    if (next && film && film.bends) report.set("magnify", next);
  }

  // The screen: metres to pixels, the same scale both ways, y upwards.
  function fit() {
    const ratio = devicePixelRatio || 1;
    const tall = (film.view[3] - film.view[1]) / (film.view[2] - film.view[0]);
    // No taller than what is left of the window below it, so that all of it is seen at once.
    const room = Math.min(Math.max(innerHeight - canvas.getBoundingClientRect().top - scrollY - 24, 320), 620);
    // Lines of writing above the mechanism, and below it where arrows of loads are explained there.
    const above = 26, below = film.keys.some((keys) => keys && keys.length) ? 22 : 0;
    canvas.style.height = `${Math.round(Math.min(Math.max(tall * canvas.clientWidth + 60 + below, 240), room))}px`;
    width = canvas.clientWidth; height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const [x0, y0, x1, y1] = film.view;
    const left = height - above - below, scale = Math.min(width / (x1 - x0), left / (y1 - y0));
    place = { scale, x: width / 2 - scale * (x0 + x1) / 2, y: left / 2 + 18 + scale * (y0 + y1) / 2 };
  }
  const px = (x) => place.x + place.scale * x;
  const py = (y) => place.y - place.scale * y;

  function trace(points, from, to) {
    pen.beginPath();
    let begun = false;
    for (let k = from; k < to; k++) {
      const x = points[2 * k], y = points[2 * k + 1];
      if (!Number.isFinite(x) || !Number.isFinite(y)) { begun = false; continue; }
      if (begun) pen.lineTo(px(x), py(y)); else pen.moveTo(px(x), py(y));
      begun = true;
    }
  }
  const line = (points, from, to) => { trace(points, from, to); pen.stroke(); };

  function drawPath() {
    if (!arrays.path) return;
    pen.setLineDash([6, 5]); pen.lineWidth = 1.4; pen.strokeStyle = colours.text; pen.globalAlpha = 0.75;
    const { values, runs } = arrays.path, long = values.length / runs, from = runs > 1 ? state.run * long : 0;
    line(values.subarray(from, from + long), 0, long / 2);
    pen.setLineDash([]); pen.globalAlpha = 1;
  }

  function drawTrail(before, drawn, tip) {
    if (!byId("trail").checked) return;
    const points = [];
    for (let frame = 0; frame <= before; frame++) {
      const start = (state.run * arrays.base.frames + frame) * arrays.base.wide + 2 * tip;
      for (const k of [start, start + 1]) points.push(arrays.base.values[k] + state.magnify * arrays.bend.values[k]);
    }
    points.push(drawn[2 * tip], drawn[2 * tip + 1]);
    pen.lineWidth = 2; pen.strokeStyle = colours.trail; pen.lineJoin = "round";
    line(points, 0, before + 2);
  }

  // Whether an arrow is of a load that does not act: it is too short to be seen.
  function hidden(look, points, from, to) {
    if (look !== "load" && look !== "head") return false;
    let far = 0;
    for (let k = from + 1; k < to; k++) far = Math.max(far, Math.hypot(points[2 * k] - points[2 * from], points[2 * k + 1] - points[2 * from + 1]));
    return !(far * place.scale > 1);
  }

  // Symbols: lines, closed or not, and dots.
  function drawMarks({ pieces }, points) {
    const dot = Math.max(2.4, Math.min(4.2, film.dot * place.scale));
    for (const [look, , from, to] of pieces) {
      if (hidden(look, points, from, to)) continue;
      const [fill, stroke, width, dashed] = film.looks[look];
      pen.setLineDash(dashed ? [6, 4] : []);
      pen.lineWidth = 1.3 * width; pen.strokeStyle = colours[stroke];
      if (to - from > 1) trace(points, from, to);
      else { pen.beginPath(); pen.arc(px(points[2 * from]), py(points[2 * from + 1]), dot, 0, 2 * Math.PI); }
      if (fill) { pen.fillStyle = colours[fill]; pen.fill(); }
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  // Names beside what they name, each where it covers least of the others, of symbols and of links, or where it was before.
  function drawNames(drawn, { pieces }, points) {
    pen.font = `600 11.5px ${getComputedStyle(document.body).fontFamily}`;
    pen.textBaseline = "middle"; pen.lineJoin = "round";
    const labels = [], written = new Set([""]), taken = [];
    for (const [look, name, from, to] of pieces) {
      if (hidden(look, points, from, to)) continue;
      const x = px(points[2 * from]), y = py(points[2 * from + 1]);
      taken.push([x, y], ...(look === "load" || look === "spring" ? along(points, from, to) : []));
      if (!written.has(name)) labels.push({ text: name, key: `${look} ${name}`, x, y, colour: look === "load" ? colours.trail : colours.soft });
      written.add(name);
    }
    film.bodies.forEach(([name, from, to], k) => {
      const middle = (from + to - 1) / 2, a = Math.floor(middle), b = Math.ceil(middle);
      const x = px((drawn[2 * a] + drawn[2 * b]) / 2), y = py((drawn[2 * a + 1] + drawn[2 * b + 1]) / 2);
      labels.push({ text: name, key: name, x, y, colour: colours.bodies[k % colours.bodies.length] });
    });
    if (labels.length <= MOST_APART) film.bodies.forEach(([, from, to]) => taken.push(...along(drawn, from, to)));
    placed(labels, taken);
    pen.lineWidth = 1; pen.strokeStyle = colours.soft;
    for (const one of labels) if (one.gap > GAPS[0]) { pen.beginPath(); pen.moveTo(one.x, one.y); pen.lineTo(one.at[0], one.at[1]); pen.stroke(); }
    pen.textAlign = "center"; pen.lineWidth = 4; pen.strokeStyle = colours.card;
    for (const { text, at, colour } of labels) { pen.strokeText(text, ...at); pen.fillStyle = colour; pen.fillText(text, ...at); }
    pen.textAlign = "start";
  }

  // Places along a link, some pixels apart.
  function along(points, from, to) {
    const out = [];
    for (let k = from + 1; k < to; k++) {
      const [x0, y0, x1, y1] = [px(points[2 * k - 2]), py(points[2 * k - 1]), px(points[2 * k]), py(points[2 * k + 1])];
      const steps = Math.min(Math.ceil(Math.hypot(x1 - x0, y1 - y0) / 8) || 1, 200);
      for (let step = 0; step <= steps; step++) out.push([x0 + (x1 - x0) * step / steps, y0 + (y1 - y0) * step / steps]);
    }
    return out;
  }

  // The middle of each label, `at`, and how far its box is from what it names, `gap`, in pixels.
  function placed(labels, taken) {
    const boxes = [], high = 7;
    for (const one of labels) {
      const wide = pen.measureText(one.text).width / 2 + 2;
      let least = Infinity;
      GAPS.forEach((gap, far) => DIRECTIONS.forEach((angle, k) => {
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        const edge = Math.min(Math.abs(c) > 1e-9 ? wide / Math.abs(c) : Infinity, Math.abs(s) > 1e-9 ? high / Math.abs(s) : Infinity);
        const x = one.x + (edge + gap) * c, y = one.y - (edge + gap) * s;
        let cost = 3 * far + 0.2 * k;
        for (const [bx, by, half] of boxes) {
          cost += 40 * Math.max(0, Math.min(1, (wide + half - Math.abs(x - bx)) / wide)) * Math.max(0, Math.min(1, 2 - Math.abs(y - by) / high));
        }
        for (const [tx, ty] of taken) if (Math.abs(x - tx) < wide + 2 && Math.abs(y - ty) < high + 1) cost += 1.5;
        if (x < wide || x > width - wide || y < 26 || y > height - high) cost += 100;
        if (stands.get(one.key) === DIRECTIONS.length * far + k) cost -= 4;
        if (cost < least) { least = cost; Object.assign(one, { at: [x, y], gap, choice: DIRECTIONS.length * far + k }); }
      }));
      stands.set(one.key, one.choice);
      boxes.push([...one.at, wide]);
    }
  }

  function drawScale() {
    const target = 110 / place.scale, power = 10 ** Math.floor(Math.log10(target));
    const length = power * [5, 2, 1].find((digit) => digit * power <= target);
    const text = length >= 1 ? `${length} m` : `${+(1000 * length).toPrecision(1)} mm`;
    const x = 12, y = height - 12;
    pen.strokeStyle = colours.soft; pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(x, y - 4); pen.lineTo(x, y); pen.lineTo(x + length * place.scale, y); pen.lineTo(x + length * place.scale, y - 4);
    pen.stroke();
    pen.fillStyle = colours.soft; pen.font = `12px ${getComputedStyle(document.body).fontFamily}`; pen.textBaseline = "alphabetic";
    pen.fillText(text, x + 5, y - 5);
    return x + length * place.scale;
  }

  // Arrows of the largest force and torque with their sizes, beside the scale.
  function drawKeys(x) {
    for (const [line, head, text] of film.keys[state.run] || []) {
      const across = [...line, ...head].filter((_, k) => k % 2 === 0), left = Math.min(...across);
      const from = x + 26, y = height - 16;
      pen.strokeStyle = pen.fillStyle = colours.trail; pen.lineWidth = 2.2;
      for (const points of [line, head]) {
        pen.beginPath();
        for (let k = 0; k < points.length; k += 2) pen.lineTo(from + place.scale * (points[k] - left), y - place.scale * points[k + 1]);
        if (points === head) pen.fill(); else pen.stroke();
      }
      x = from + place.scale * (Math.max(...across) - left) + 6;
      pen.textBaseline = "middle"; pen.fillText(text, x, y);
      x += pen.measureText(text).width;
    }
  }

  function drawCaption(stopped) {
    pen.font = `13px ${getComputedStyle(document.body).fontFamily}`; pen.textBaseline = "top"; pen.fillStyle = colours.soft;
    const run = page.runs.length > 1 || report.runName() ? `${report.runName()}   ` : "";
    const by = film.periodic ? `   displacements × ${state.magnify}` : state.magnify !== 1 ? `   deflections × ${state.magnify}` : film.bends && width > 420 ? "   true deflections" : "";
    const caption = `${named ? "" : film.periodic ? "phase " : "t = "}${secondsText(state.time)}${by}`;
    // On a narrow screen the buttons alone name the run.
    pen.fillText(pen.measureText(run + caption).width < width - 24 ? run + caption : caption, 12, 8);
    if (stopped !== null) { pen.fillStyle = colours.mark; pen.fillText(`this run ended at ${secondsText(stopped)}`, 12, 27); }
  }

  function paint() {
    waiting = false;
    if (!arrays || !canvas.clientWidth) return;
    if (canvas.clientWidth !== width || canvas.clientHeight !== height || canvas.width !== Math.round(width * (devicePixelRatio || 1))) fit();
    pen.clearRect(0, 0, width, height);
    let [before, share] = report.between(times, state.time);
    const farthest = lastFrame(arrays.base, state.run);
    const stopped = farthest < times.length - 1 && (farthest < 0 || state.time > times[farthest]);
    if (stopped) [before, share] = [Math.max(farthest, 0), 0];
    else if (before >= farthest) share = before + 1 > farthest ? 0 : share;
    drawPath();
    if (farthest >= 0) {
      const base = valuesAt(arrays.base, state.run, before, share), bend = valuesAt(arrays.bend, state.run, before, share);
      const [still, moving] = film.marks[state.run], [ground, points] = arrays.marks[state.run].map((one) => valuesAt(one, 0, before, share));
      const swing = arrays.swing[state.run] && valuesAt(arrays.swing[state.run], 0, before, share);
      if (swing) for (let k = 0; k < points.length; k++) points[k] += (state.magnify - 1) * swing[k];
      const drawn = base.map((value, k) => value + state.magnify * bend[k]), tips = film.tips[state.run] || [];
      pen.lineCap = pen.lineJoin = "round";
      drawMarks(still, ground);
      pen.globalAlpha = stopped ? 0.45 : 1;
      if (byId("ghost").checked && (state.magnify > 1 || film.periodic)) {
        pen.strokeStyle = colours.soft; pen.lineWidth = 1.2; pen.setLineDash([3, 4]);
        for (const [, from, to] of film.bodies) line(base, from, to);
        pen.setLineDash([]);
      }
      film.bodies.forEach(([, from, to, plate], k) => {
        pen.strokeStyle = colours.card; pen.lineWidth = 7; line(drawn, from, to);
        pen.strokeStyle = pen.fillStyle = colours.bodies[k % colours.bodies.length];
        if (plate) { pen.save(); pen.globalAlpha *= 0.25; pen.fill(); pen.restore(); }
        pen.lineWidth = 3.6; line(drawn, from, to);
      });
      // Over the links: they often lie along it.
      for (const tip of tips) drawTrail(before, drawn, tip);
      drawMarks(moving, points);
      for (const tip of tips) {
        pen.fillStyle = colours.trail; pen.strokeStyle = colours.card; pen.lineWidth = 1.5;
        pen.beginPath(); pen.arc(px(drawn[2 * tip]), py(drawn[2 * tip + 1]), 5, 0, 2 * Math.PI); pen.fill(); pen.stroke();
      }
      if (byId("names").checked) drawNames(drawn, moving, points);
      pen.globalAlpha = 1;
    }
    drawKeys(drawScale());
    drawCaption(stopped ? (farthest < 0 ? times[0] : times[farthest]) : null);
  }

  // One painting a frame of the screen, however much changes in it.
  function repaint() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(paint);
  }

  function recolour() {
    colours = { bodies: report.palette() };
    for (const name of ["text", "soft", "card", "mark", "trail"]) colours[name] = report.colour(name);
    Object.assign(colours, { ground: colours.card, ink: colours.text, earth: colours.soft });
    repaint();
  }

  function showTime() {
    const scrub = byId("scrub");
    scrub.value = String(Math.round(1000 * (state.time - times[0]) / Math.max(end() - times[0], 1e-12)));
    scrub.setAttribute("aria-valuetext", secondsText(state.time));
    byId("time").textContent = secondsText(state.time);
    repaint();
  }

  function showMagnification() {
    const text = state.magnify < 10 ? String(+state.magnify.toPrecision(2)) : String(Math.round(state.magnify));
    byId("magnified").textContent = text;
    const slider = byId("magnify");
    slider.setAttribute("aria-valuetext", `${text} times`);
    if (document.activeElement !== slider) slider.value = String(Math.round(100 * Math.log(state.magnify) / Math.log(LARGEST)));
    repaint();
  }

  function connect() {
    byId("play").addEventListener("click", () => play(!state.playing));
    byId("scrub").addEventListener("input", (event) => { play(false); seek(times[0] + event.target.value / 1000 * (end() - times[0])); });
    byId("magnify").addEventListener("input", (event) => {
      const exact = LARGEST ** (event.target.value / 100);
      report.set("magnify", exact < 10 ? +exact.toPrecision(2) : Math.round(exact));
    });
    const choose = byId("speed");
    const nearest = SPEEDS.reduce((a, b) => (Math.abs(Math.log(b * 7 / end())) < Math.abs(Math.log(a * 7 / end())) ? b : a));
    speed = film && film.periodic ? 1 : Math.min(nearest, 1);
    for (const one of SPEEDS) choose.append(new Option(`${one} ×`, one, one === speed, one === speed));
    choose.addEventListener("change", () => { speed = Number(choose.value); });
    for (const name of ["ghost", "trail", "names"]) byId(name).addEventListener("change", repaint);
    report.on("time", showTime);
    report.on("magnify", showMagnification);
    report.on("run", repaint);
    report.on("theme", recolour);
    report.on("playing", (on) => {
      byId("play").textContent = on ? "❚❚" : "▶";
      byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
    });
    new ResizeObserver(repaint).observe(canvas);
    canvas.addEventListener("click", () => play(!state.playing));
  }

  async function start() {
    times = film ? film.time : report.row(page.time);
    if (!(times.length > 1)) times = [0, 1];
    seek(times[0]);
    connect();
    showTime();
    if (!film) {
      byId("no-film").hidden = !byId("no-film").textContent;
      for (const name of ["tools", "canvas", "key-magnify"]) byId(name).hidden = true;
      // Charts of nothing that moves need neither its place nor its clock.
      if (byId("no-film").hidden && !report.row(page.time).length) {
        for (const name of ["film", "dock"]) byId(name).hidden = true;
        byId("moving").classList.add("still");
      }
      return;
    }
    // Rigid links have no deflections to magnify.
    if (!film.bends) for (const name of ["has-magnify", "has-ghost", "key-magnify"]) byId(name).hidden = true;
    byId("has-trail").hidden = film.tips.every((tips) => !tips || !tips.length);
    const names = ["base", "bend", "path"];
    const read = await Promise.all(names.map((name) => (film[name] ? report.unpacked(film[name]) : null)));
    const marks = await Promise.all(film.marks.map((sets) => Promise.all((sets || []).map((set) => report.unpacked(set.places)))));
    const swing = await Promise.all(film.swing.map((one) => (one ? report.unpacked(one) : null)));
    // At once and last: from here on the page may paint.
    arrays = { ...Object.fromEntries(names.map((name, k) => [name, read[k]])), marks, swing };
    showMagnification();
    recolour();
  }

  return { start, seek, play, step, magnify, end };
})();
