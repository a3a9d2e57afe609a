"use strict";
// What all parts of the page share: the numbers, what is selected and when it is, the theme.
const report = (() => {
  const told = JSON.parse(document.getElementById("report-data").textContent);
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const listeners = { run: [], time: [], theme: [], magnify: [], playing: [] };
  const state = { run: told.selected, time: 0, magnify: told.film ? told.film.magnify : 1, playing: false };
  let rows = [];

  async function inflated(text) {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // All first bytes come first, then all second ones.
  function gathered(bytes, width) {
    const count = bytes.length / width;
    const out = new Uint8Array(bytes.length);
    for (let part = 0, from = 0; part < width; part++) {
      for (let k = part; k < out.length; k += width) out[k] = bytes[from++];
    }
    return { buffer: out.buffer, count };
  }

  async function readSeries() {
    const { buffer } = gathered(await inflated(told.series.data), 4);
    let from = 0;
    rows = told.series.lengths.map((length) => {
      const row = new Float32Array(buffer, 4 * from, length);
      from += length;
      return row;
    });
    delete told.series.data;
  }

  // An array (runs, frames, ...) with x, y last, in metres; NaN where there is nothing.
  async function unpacked(array) {
    const { buffer } = gathered(await inflated(array.data), 2);
    const whole = new Int16Array(buffer);
    const [runs, frames] = array.shape;
    const wide = whole.length / (runs * frames) || 0;
    const values = new Float32Array(whole.length);
    for (let run = 0; run < runs; run++) {
      for (let frame = 0; frame < frames; frame++) {
        const start = (run * frames + frame) * wide;
        for (let k = 0; k < wide; k++) {
          if (frame > 0) whole[start + k] += whole[start + k - wide];
          const number = whole[start + k];
          values[start + k] = number === -32768 ? NaN : array.offset[k % 2] + array.scale * number;
        }
      }
    }
    return { values, runs, frames, wide };
  }

  const isDark = () => (root.dataset.theme === "auto" ? dark.matches : root.dataset.theme === "dark");
  const colour = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
  // Okabe and Ito's colours, apart for eyes of all kinds; lighter ones on a dark ground.
  const palettes = {
    light: ["#0072b2", "#d55e00", "#009e73", "#b04a8a", "#4a4a4a", "#c98700", "#3fa0db", "#7a5195"],
    dark: ["#56b4e9", "#ff8a3d", "#2fd0a0", "#e79bc5", "#d8dce2", "#f0c93a", "#8fa8ff", "#b98a5a"],
  };
  const palette = () => palettes[isDark() ? "dark" : "light"];

  function tell(what) {
    for (const listener of listeners[what]) listener(state[what]);
  }

  function set(what, value) {
    if (state[what] === value) return;
    state[what] = value;
    tell(what);
  }

  function setTheme(name, keep = true) {
    root.dataset.theme = name;
    if (keep) try { localStorage.setItem("paraflex-theme", name); } catch (refused) { /* a file's storage may be closed */ }
    tell("theme");
  }
  dark.addEventListener("change", () => root.dataset.theme === "auto" && tell("theme"));

  // Where a time is among ascending ones: the sample before it and the share of the way to the next.
  function between(times, time) {
    let low = 0, high = times.length - 1;
    if (!(time > times[0])) return [0, 0];
    if (time >= times[high]) return [Math.max(0, high - 1), high > 0 ? 1 : 0];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle; else high = middle;
    }
    return [low, (time - times[low]) / (times[high] - times[low])];
  }

  const element = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };

  return {
    told, state, set, setTheme, isDark, colour, palette, readSeries, unpacked, between, element,
    row: (number) => rows[number],
    on: (what, listener) => listeners[what].push(listener),
    runName: () => told.runs[state.run] || "",
  };
})();
