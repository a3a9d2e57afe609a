// Many designs: each chosen number over another, all at once, their front, their spread; tables that sort.
const designs = (() => {
  const { page, state, element } = report;
  const { designs: own } = page;
  const GROUPS = 12, MOST_LINES = 60;
  const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const numberText = (value) => (Number.isFinite(value) ? String(+value.toPrecision(4)) : "–");
  let columns = [], series = [], members = [], count = 0, hovers = [];

  const columnName = (column) => own.columns[column].name;
  const label = (column) => columns[column].name + (columns[column].unit ? ` [${columns[column].unit}]` : "");
  const colour = (k) => report.palette()[series[k].colour ?? 0];
  const SYMBOLS = ["circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "x", "star"];

  function read() {
    columns = own.columns.map((column) => ({ ...column, values: report.row(column.row) }));
    const member = report.row(own.member);
    count = member.length;
    series = own.series;
    members = series.map((_, k) => [...member.keys()].filter((row) => member[row] === k));
    const number = report.row(own.number);
    const varied = columns.filter((column) => column.parameter);
    hovers = [...member.keys()].map((row) => [
      `<b>#${number[row]}  ${plain(series[member[row]].name)}</b>`,
      ...varied.map((column) => `${plain(column.name)} ${numberText(column.values[row])} ${column.unit}`),
    ].join("<br>"));
  }

  const shownRow = () => report.row(own.shown).indexOf(state.run);

  function axisOf(column, more = {}) {
    const { values, log } = columns[column];
    const title = { text: plain(label(column)), standoff: 8, font: { size: 12.5 } };
    if (!log) return { title, type: "linear", hoverformat: ".4~g", ...more };
    const known = values.filter((value) => value > 0);
    const most = known.reduce((a, b) => Math.max(a, b), 0), least = known.reduce((a, b) => Math.min(a, b), Infinity);
    return { title, type: "log", dtick: most > 200 * least ? 1 : "D2", tickformat: "~g", hoverformat: ".4~g", ...more };
  }

  // Numbers of axes without powers of ten where they are of a common size.
  function formatOf(values) {
    const most = values.reduce((a, b) => (Number.isFinite(b) ? Math.max(a, Math.abs(b)) : a), 0);
    return most >= 1e-3 && most < 1e6 ? ".3~r" : ".3~g";
  }

  // Marks of some rows in the look of their series; hovered, they tell their design.
  function marks(rows, k, x, y, more = {}) {
    return {
      type: "scatter", mode: "markers", name: plain(series[k].name), legendgroup: `${k}`,
      x: rows.map((row) => columns[x].values[row]), y: rows.map((row) => columns[y].values[row]), customdata: rows,
      text: rows.map((row) => hovers[row]),
      hovertemplate: `%{text}<br>${plain(columns[y].name)} %{y:.4~g} ${columns[y].unit}<extra></extra>`,
      marker: { color: colour(k), symbol: SYMBOLS[k % SYMBOLS.length], size: rows.length > 800 ? 4 : 6.5, opacity: rows.length > 300 ? 0.45 : 0.7 },
      ...more,
    };
  }

  // A ring round the run that the animation shows.
  function ring(x, y) {
    const row = shownRow();
    if (row < 0) return [];
    return [{
      type: "scatter", mode: "markers", x: [columns[x].values[row]], y: [columns[y].values[row]], showlegend: false,
      hoverinfo: "skip", marker: { symbol: "circle-open", size: 15, color: report.colour("text"), line: { width: 2.2 } },
    }];
  }

  const legend = () => ({
    showlegend: series.length > 1,
    legend: { orientation: "h", x: 0, y: 1.01, yanchor: "bottom", font: { size: 12 }, itemsizing: "constant" },
    margin: { l: 66, r: 14, t: series.length > 1 ? 34 : 12, b: 46 }, hovermode: "closest",
  });

  function median(values) {
    const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
    const half = sorted.length >> 1;
    if (!sorted.length) return NaN;
    return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
  }

  // Medians over a parameter: at each of its values, or in groups of as many runs.
  function medians(rows, x, y) {
    const across = columns[x].values, up = columns[y].values;
    const sorted = [...rows].sort((a, b) => across[a] - across[b]);
    const levels = [...new Set(sorted.map((row) => across[row]))];
    let groups;
    if (levels.length <= GROUPS) groups = levels.map((level) => sorted.filter((row) => across[row] === level));
    else {
      groups = [];
      for (let k = 0, from = 0; k < GROUPS; k++) {
        const size = Math.floor(sorted.length / GROUPS) + (k < sorted.length % GROUPS ? 1 : 0);
        groups.push(sorted.slice(from, from += size));
      }
      groups = groups.filter((group) => group.length);
    }
    return { x: groups.map((group) => median(group.map((row) => across[row]))), y: groups.map((group) => median(group.map((row) => up[row]))) };
  }

  // Runs alike in all other parameters, which a grid has: their lines, or none.
  function gridLines(rows, x, y) {
    const others = columns.filter((column, k) => column.parameter && k !== x);
    const groups = new Map();
    for (const row of rows) {
      const key = others.map((column) => column.values[row]).join();
      groups.set(key, [...(groups.get(key) || []), row]);
    }
    if (groups.size > MOST_LINES || rows.length < 2 * groups.size) return null;
    const line = { x: [], y: [], alone: groups.size === 1 };
    for (const group of groups.values()) {
      for (const row of group.sort((a, b) => columns[x].values[a] - columns[x].values[b])) {
        line.x.push(columns[x].values[row]); line.y.push(columns[y].values[row]);
      }
      line.x.push(null); line.y.push(null);
    }
    return line;
  }

  const DASHES = ["solid", "dash", "dot", "dashdot", "longdash"];
  const lineOf = (k, width) => ({ color: colour(k), dash: DASHES[series[k].dash], width });

  function responses(y, x) {
    const several = columns.filter((column) => column.parameter).length > 1;
    const data = members.map((rows, k) => marks(rows, k, x, y));
    const over = members.flatMap((rows, k) => {
      const out = [];
      const lines = gridLines(rows, x, y);
      const quiet = { type: "scatter", mode: "lines", hoverinfo: "skip", legendgroup: `${k}`, showlegend: false };
      if (lines) out.push({ ...quiet, x: lines.x, y: lines.y, line: lineOf(k, lines.alone ? 1.8 : 0.8), opacity: lines.alone ? 1 : 0.55 });
      if (several && (!lines || !lines.alone) && rows.length > 4) out.push({ ...quiet, ...medians(rows, x, y), line: { ...lineOf(k, 2.6), shape: "linear" } });
      return out;
    });
    return { data: [...data, ...over, ...ring(x, y)], layout: { ...legend(), xaxis: axisOf(x), yaxis: axisOf(y) } };
  }

  // Rows, in order of x, that no other is below in one number without being above in the other.
  function undominated(rows, x, y) {
    const across = columns[x].values, up = columns[y].values;
    const known = rows.filter((row) => Number.isFinite(across[row]) && Number.isFinite(up[row]));
    known.sort((a, b) => across[a] - across[b] || up[a] - up[b]);
    let least = Infinity;
    return known.filter((row) => up[row] < least && ((least = up[row]), true));
  }

  function front(x, y) {
    const data = members.flatMap((rows, k) => {
      const best = undominated(rows, x, y);
      return [
        marks(rows, k, x, y, { showlegend: false, marker: { color: colour(k), symbol: SYMBOLS[k % SYMBOLS.length], size: 4.5, opacity: 0.32 } }),
        marks(best, k, x, y, {
          mode: "lines+markers", line: { ...lineOf(k, 1.8), shape: "hv" },
          marker: { color: colour(k), symbol: SYMBOLS[k % SYMBOLS.length], size: 8.5, line: { width: 1, color: report.colour("card") } },
        }),
      ];
    });
    return { data: [...data, ...ring(x, y)], layout: { ...legend(), xaxis: axisOf(x), yaxis: axisOf(y) } };
  }

  function distribution(x) {
    const log = columns[x].log, at = (row) => (log ? Math.log10(columns[x].values[row]) : columns[x].values[row]);
    const known = members.map((rows) => rows.map(at).filter(Number.isFinite));
    const all = known.flat();
    const low = all.reduce((a, b) => Math.min(a, b), Infinity), high = all.reduce((a, b) => Math.max(a, b), -Infinity);
    const bins = Math.min(40, Math.max(8, Math.round(3 * Math.cbrt(Math.max(...known.map((values) => values.length))))));
    const size = (high - low) / bins || 1;
    let most = 0;
    const back = (value) => (log ? 10 ** value : value);
    const data = known.map((values, k) => {
      const counts = new Array(bins).fill(0);
      for (const value of values) counts[Math.min(bins - 1, Math.max(0, Math.floor((value - low) / size)))]++;
      most = Math.max(most, ...counts);
      const edges = counts.flatMap((_, bin) => [back(low + bin * size), back(low + (bin + 1) * size)]);
      return {
        type: "scatter", mode: "lines", fill: "tozeroy", fillcolor: `${colour(k)}30`, name: plain(series[k].name), line: lineOf(k, 1.8),
        x: [edges[0], ...edges, edges.at(-1)], y: [0, ...counts.flatMap((number) => [number, number]), 0],
        hovertemplate: `%{y} runs<extra>${plain(series[k].name)}</extra>`,
      };
    });
    return { data, layout: { ...legend(), xaxis: axisOf(x), yaxis: { title: { text: "runs", standoff: 8, font: { size: 12.5 } }, rangemode: "tozero", tickformat: "d", dtick: most <= 8 ? 1 : undefined } } };
  }

  // Small values stand out, for less is better.
  const scales = {
    light: [[0, "#3b0f70"], [0.3, "#8c2981"], [0.6, "#de6a5c"], [1, "#fcc88f"]],
    dark: [[0, "#fde7a5"], [0.3, "#fb8861"], [0.6, "#b5367a"], [1, "#513a8c"]],
  };

  const short = (text, most = 22) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);

  function parallelAxes(judge) {
    const metrics = columns.map((_, k) => k).filter((k) => !columns[k].parameter).slice(0, 6);
    const parameters = columns.map((_, k) => k).filter((k) => columns[k].parameter).slice(0, 8);
    return [...parameters, ...(metrics.includes(judge) ? metrics : [...metrics.slice(0, 5), judge])];
  }

  function parallel(judge) {
    const rows = [...members.flat()].filter((row) => Number.isFinite(columns[judge].values[row]));
    const shown = parallelAxes(judge);
    const member = report.row(own.member);
    const named = series.length > 1 ? [{
      label: own.telling, values: rows.map((row) => member[row]), range: [-0.3, series.length - 0.7],
      tickvals: series.map((_, k) => k), ticktext: series.map((one) => plain(short(one.name))),
    }] : [];
    const values = rows.map((row) => columns[judge].values[row]);
    const log = columns[judge].log;
    const dimensions = shown.map((k) => {
      const values = rows.map((row) => columns[k].values[row]), logged = columns[k].log;
      const scaled = logged ? values.map(Math.log10) : values;
      const ticks = logged ? logTicks(values) : {};
      return { label: plain(short(columns[k].name)) + (columns[k].unit ? `<br>[${columns[k].unit}]` : ""), values: scaled, tickformat: formatOf(values), ...ticks };
    });
    return {
      data: [{
        type: "parcoords", dimensions: [...named, ...dimensions], labelfont: { size: 12 }, tickfont: { size: 10.5 }, rangefont: { size: 10, color: "rgba(0,0,0,0)" }, labelside: "top",
        line: {
          color: log ? values.map(Math.log10) : values, colorscale: scales[report.isDark() ? "dark" : "light"], showscale: true,
          colorbar: { thickness: 12, outlinewidth: 0, tickfont: { size: 10.5 }, title: { text: plain(columns[judge].unit ? `[${columns[judge].unit}]` : ""), font: { size: 11 } }, ...(log ? logTicks(values) : { tickformat: formatOf(values) }) },
        },
        unselected: { line: { color: report.colour("line"), opacity: 0.25 } },
      }],
      layout: { noAxes: true, margin: { l: Math.max(62, 26 + 7.5 * Math.max(...series.map((one) => short(one.name).length))), r: 40, t: 62, b: 24 } },
    };
  }

  function logTicks(values) {
    const known = values.filter((value) => value > 0);
    const low = known.reduce((a, b) => Math.min(a, b), Infinity), high = known.reduce((a, b) => Math.max(a, b), 0), ticks = [];
    const digits = high > 200 * low ? [1] : [1, 2, 5];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      for (const digit of digits) {
        const value = digit * 10 ** power;
        if (value >= low * 0.999 && value <= high * 1.001) ticks.push(value);
      }
    }
    return { tickvals: ticks.map(Math.log10), ticktext: ticks.map((value) => numberText(value)) };
  }

  const drawers = { responses, front, parallel, distribution };

  function figure(chart) {
    const picked = chart.description.pickers.map((picker, k) => picker.columns[chart.picked[k]]);
    // As wide as its axes' names need: it scrolls in its holder where that is narrower.
    if (chart.description.drawer === "parallel") chart.plot.style.minWidth = `${100 * (parallelAxes(picked[0]).length + 1)}px`;
    return drawers[chart.description.drawer](...picked);
  }

  // A point clicked at is the run shown, where it is one of those.
  function choose(point) {
    if (!point || point.customdata === undefined) return;
    const run = report.row(own.shown)[point.customdata];
    if (run >= 0) report.set("run", run);
  }

  // Tables whose heads sort by the rows' keys: up, then down.
  function sortable(table) {
    const body = table.tBodies[0];
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const keyed = (row) => JSON.parse(row.dataset.keys)[column];
      if (![...body.rows].some((row) => keyed(row) !== null)) return;
      const button = element("button", { type: "button", class: "sort", title: "sort" }, ...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending";
        for (const each of table.tHead.rows[0].cells) each.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        const order = (a, b) => (a === null) - (b === null) || (down ? -1 : 1) * (typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a < b ? -1 : a > b ? 1 : 0);
        body.append(...[...body.rows].sort((a, b) => order(keyed(a), keyed(b))));
      });
    });
  }

  function start() {
    for (const table of document.querySelectorAll("table.sortable")) sortable(table);
    if (own) read();
  }

  return { start, figure, choose, columnName };
})();
