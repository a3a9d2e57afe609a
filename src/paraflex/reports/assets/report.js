// What all parts of the page share: the numbers, what is selected and when it is, the theme.
const report = (() => {
  const page = JSON.parse(document.getElementById("report-data").textContent);
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const listeners = { run: [], time: [], over: [], theme: [], magnify: [], playing: [] };
  const state = { run: page.selected, time: 0, over: page.over, magnify: page.film ? page.film.magnify : 1, playing: false };
  let rows = [];

  async function readSeries() {
    rows = await seriesRows(page.series);
    delete page.series.data;
  }

  const isDark = () => (root.dataset.theme === "auto" ? dark.matches : root.dataset.theme === "dark");
  const colour = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
  const palette = () => page.palettes[isDark() ? "dark" : "light"];

  function notify(what) {
    for (const listener of listeners[what]) listener(state[what]);
  }

  function set(what, value) {
    if (state[what] === value) return;
    state[what] = value;
    notify(what);
  }

  function setTheme(name, keep = true) {
    root.dataset.theme = name;
    if (keep) try { localStorage.setItem("paraflex-theme", name); } catch (refused) { /* a file's storage may be closed */ }
    notify("theme");
  }
  dark.addEventListener("change", () => root.dataset.theme === "auto" && notify("theme"));

  const element = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };

  return {
    page, state, set, setTheme, isDark, colour, palette, inflated, readSeries, unpacked, between, element,
    row: (number) => rows[number],
    on: (what, listener) => listeners[what].push(listener),
    runName: () => page.runs[state.run] || "",
  };
})();
