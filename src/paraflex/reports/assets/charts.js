// Charts: drawn by Plotly when they come into view, again when what they show changes.
const charts = (() => {
  const { page, state, element } = report;
  const DASHES = ["solid", "dash", "dot", "dashdot", "longdash"];
  const MARKS = { ring: "circle-open", cross: "x-thin-open", square: "square", dot: "circle", triangle: "triangle-up", diamond: "diamond" };
  const RING = "M17 5a4 4 0 1 1 -8 0a4 4 0 1 1 8 0";
  const SHAPES = { ring: RING, dot: RING, cross: "M9 1L17 9M9 9L17 1", square: "M10 2h6v6h-6z", triangle: "M13 1l4 7h-8z", diamond: "M13 1l4 4l-4 4l-4 -4z", bar: "M4 3h18v4h-18z" };
  const SAMPLES = ["", "6 3", "1.5 2.5", "6 2.5 1.5 2.5", "9 3"];
  // On paper: width of charts, height of flat ones, and the size of the titles beside them [px].
  const PAPER = 640, LOW = 200, LOW_TITLE = 10;
  // Charts of a panel that stand open; more are folded.
  const MOST_OPEN = 6;
  const all = [];

  // Plotly reads tags in text; names are not to be read so.
  const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const lineColour = (curve) => (curve.colour === null ? report.colour("text") : report.palette()[curve.colour]);
  const isShown = (chart, curve) =>
    (curve.shown === null || curve.shown.includes(state.run)) && (curve.choice === null || curve.choice === chart.choice);

  // Charts whose choices are different quantities have a label for each.
  const yLabel = (chart) => {
    const label = chart.description.y;
    return Array.isArray(label) ? label[label.length > 1 ? chart.choice : 0] : label;
  };

  // Charts over time may be over another quantity; curves may have sample times of their own.
  const isOverTime = (chart) => chart.description.over_time && !state.over;
  const abscissa = (chart) => (chart.description.over_time && state.over ? page.abscissae[state.over - 1] : null);
  const at = (row, [before, share]) => row[before] + (share ? share * (row[before + 1] - row[before]) : 0);

  function xRow(chart, curve) {
    const own = report.row(curve.x), over = abscissa(chart), times = report.row(page.time);
    if (!over) return own;
    const values = report.row(over.rows[curve.run ?? state.run]);
    return own === times ? values : own.map((time) => at(values, report.between(times, time)));
  }

  const isOwn = (chart) => Boolean(chart.description.drawer);
  const ownFigure = (chart) => (isOwn(chart) ? designs.figure(chart) : null);

  function traces(chart) {
    const own = ownFigure(chart);
    if (own) return own.data;
    const shown = chart.description.curves.filter((curve) => isShown(chart, curve));
    const beside = new Set(shown.filter((curve) => curve.run !== null).map((curve) => curve.run)).size > 1;
    return shown.map((curve) => {
      const chosen = beside && curve.run === state.run;
      if (curve.mark === "bar") return {
        type: "bar", orientation: "h", name: plain(curve.name), x: report.row(curve.x), y: report.row(curve.y), width: curve.thickness,
        marker: { color: lineColour(curve) }, hovertemplate: "%{x:.4~g}<extra>%{fullData.name}</extra>", visible: chart.hidden.has(curve.name) ? "legendonly" : true,
      };
      if (curve.mark) return {
        type: "scatter", mode: curve.line ? "lines+markers" : "markers", line: { color: lineColour(curve), dash: DASHES[curve.dash], width: 1.4 }, name: plain(curve.name), x: xRow(chart, curve), y: report.row(curve.y),
        opacity: curve.faint ? 0.5 : 1,
        marker: { symbol: MARKS[curve.mark], color: lineColour(curve), size: curve.faint ? 6 : (curve.size ?? 1) * (curve.mark === "ring" ? 9 : 8), line: { width: 1.6, color: lineColour(curve) } },
        text: curve.texts.map(plain), hovertemplate: `${curve.texts.length ? "%{text}" : "%{x:.4~g}, %{y:.4~g}"}<extra>%{fullData.name}</extra>`, visible: chart.hidden.has(curve.name) ? "legendonly" : true,
      };
      return {
        type: "scatter", mode: "lines", name: plain(curve.name),
        x: xRow(chart, curve), y: report.row(curve.y),
        line: {
          color: lineColour(curve), dash: DASHES[curve.dash], width: chosen ? 2.8 : beside ? 1.4 : 1.7,
          simplify: false,
        },
        opacity: beside && !chosen ? 0.8 : 1,
        visible: chart.hidden.has(curve.name) ? "legendonly" : true,
        ...(curve.quiet ? { hoverinfo: "skip" } : { hovertemplate: `${abscissa(chart) ? "%{x:.4~g}, " : ""}%{y:.4~g}<extra>%{fullData.name}</extra>` }),
      };
    });
  }

  function axis(title, more) {
    return {
      title: { text: plain(title), standoff: 8, font: { size: 12.5 } }, gridcolor: report.colour("grid"),
      linecolor: report.colour("line"), zeroline: false, showline: true, ticks: "outside", ticklen: 4,
      tickcolor: report.colour("line"), exponentformat: "power", ...more,
    };
  }

  // What is far below the largest value is no more than rounding, or the start at rest.
  const MOST_DECADES = 5;
  // Over less than two decades ones, twos and fives stand; within one there may be none, and Plotly chooses.
  const steps = (range) => {
    const span = range ? range[1] - range[0] : 2;
    return span > 1.5 ? { dtick: 1 } : span > 0.7 ? { dtick: "D2" } : { nticks: 6 };
  };

  function decades(chart) {
    let low = Infinity, high = 0;
    for (const curve of chart.description.curves) {
      if (!isShown(chart, curve)) continue;
      for (const value of report.row(curve.y)) {
        if (value > 0 && value < low) low = value;
        if (value > high && value < Infinity) high = value;
      }
    }
    if (!(high > 0)) return undefined;
    const top = Math.log10(high), bottom = Math.max(Math.log10(low), top - MOST_DECADES);
    const room = 0.06 * Math.max(top - bottom, 0.3);
    return [bottom - room, top + room];
  }

  function layout(chart) {
    const { log, log_x: logX, equal, layout: added } = chart.description;
    const over = abscissa(chart), overTime = isOverTime(chart);
    const figure = ownFigure(chart);
    const common = {
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false,
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: report.colour("text") },
      margin: { l: 62, r: 14, t: 10, b: 44 }, colorway: report.palette(),
      hoverlabel: { bgcolor: report.colour("card"), bordercolor: report.colour("line"), font: { color: report.colour("text") } },
      modebar: { color: report.colour("soft"), activecolor: report.colour("accent"), bgcolor: "rgba(0,0,0,0)" },
      // What the reader zoomed to stays while other runs are looked at.
      uirevision: `${chart.choice} ${chart.picked} ${over ? state.over : 0}`,
    };
    if (figure) {
      const { xaxis, yaxis, noAxes, ...own } = figure.layout || {};
      return { ...common, ...own, ...(noAxes ? {} : { xaxis: axis(chart.description.x, xaxis), yaxis: axis(yLabel(chart), yaxis) }) };
    }
    return {
      ...common,
      hovermode: overTime ? "x unified" : "closest", barmode: "overlay",
      xaxis: axis(over ? over.label : chart.description.x, overTime ? { range: report.timeRange, hoverformat: ".4~g" } : logX ? { type: "log", dtick: 1, tickformat: "~g", hoverformat: ".4~g" } : added.xaxis || {}),
      yaxis: axis(yLabel(chart), { automargin: true, ...(log ? { type: "log", range: decades(chart), tickformat: "~g", ...steps(decades(chart)) } : {}), ...(equal && !added.xaxis ? { scaleanchor: "x" } : {}), hoverformat: ".4~g", ...added.yaxis }),
      shapes: (added.shapes || []).filter((shape) => !over || shape.type === "line"),
    };
  }

  // A chart is never sent anywhere: no button offers it, and there is no address.
  const config = {
    displaylogo: false, responsive: true, showSendToCloud: false, showEditInChartStudio: false, plotlyServerURL: "",
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "zoomIn2d", "zoomOut2d", "pan2d", "sendDataToCloud", "sendChartToCloud"],
  };

  async function draw(chart) {
    chart.stale = false;
    const first = !chart.drawn;
    chart.drawn = true;
    await Plotly.react(chart.plot, traces(chart), layout(chart), { ...config, toImageButtonOptions: { filename: chart.description.identity, format: "svg" } });
    if (first) {
      chart.plot.on("plotly_afterplot", () => moveCursor(chart));
      if (chart.description.drawer) chart.plot.on("plotly_click", (event) => designs.choose(event.points[0]));
      else if (chart.description.over_time) chart.plot.on("plotly_click", (event) => isOverTime(chart) && player.seek(event.points[0].x));
    }
    drawLegend(chart);
    moveCursor(chart);
  }

  function sample(curve, mixed) {
    const stroke = mixed ? report.colour("text") : lineColour(curve);
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("width", "26"); svg.setAttribute("height", "10"); svg.setAttribute("aria-hidden", "true");
    const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
    for (const [name, value] of Object.entries({ x1: 0, x2: 26, y1: 5, y2: 5, stroke, "stroke-width": 2, "stroke-dasharray": SAMPLES[curve.dash] })) line.setAttribute(name, value);
    if (!curve.mark || curve.line) svg.append(line);
    if (curve.mark) {
      const mark = document.createElementNS("http://www.w3.org/2000/svg", "path");
      const fill = ["square", "dot", "bar"].includes(curve.mark) ? stroke : "none";
      for (const [name, value] of Object.entries({ d: SHAPES[curve.mark], stroke, "stroke-width": 1.6, fill })) mark.setAttribute(name, value);
      svg.append(mark);
    }
    return svg;
  }

  function drawLegend(chart) {
    const byName = new Map();
    for (const curve of chart.description.curves) {
      if (curve.name && isShown(chart, curve)) byName.set(curve.name, [...(byName.get(curve.name) || []), curve]);
    }
    chart.legend.replaceChildren();
    if (byName.size < 2) return;
    for (const [name, curves] of byName) {
      const button = element("button", { type: "button", "aria-pressed": String(!chart.hidden.has(name)), title: "show or hide" });
      button.append(sample(curves[0], curves.some((curve) => curve.colour !== curves[0].colour)), name);
      button.addEventListener("click", () => {
        if (!chart.hidden.delete(name)) chart.hidden.add(name);
        button.setAttribute("aria-pressed", String(!chart.hidden.has(name)));
        Plotly.restyle(chart.plot, { visible: traces(chart).map((trace) => trace.visible) });
      });
      chart.legend.append(button);
    }
  }

  // A line at the time over time; else a dot on every curve of the selected run.
  function moveCursor(chart) {
    const drawn = chart.plot._fullLayout;
    if (!chart.drawn || isOwn(chart) || !drawn || !drawn.xaxis || !drawn.xaxis._length) return;
    const { xaxis, yaxis } = drawn;
    const inside = (x, y) => x >= -1 && x <= xaxis._length + 1 && y >= -1 && y <= yaxis._length + 1;
    const put = (mark, x, y) => {
      const shows = Number.isFinite(x) && Number.isFinite(y) && inside(x, y);
      mark.style.visibility = shows ? "visible" : "hidden";
      if (shows) mark.style.transform = `translate(${xaxis._offset + x}px, ${yaxis._offset + y}px)`;
    };
    if (isOverTime(chart)) {
      for (const dot of chart.dots) dot.style.visibility = "hidden";
      chart.cursor.style.height = `${yaxis._length}px`;
      put(chart.cursor, xaxis.d2p(state.time), 0);
      return;
    }
    chart.cursor.style.visibility = "hidden";
    const curves = chart.description.curves.filter(
      (curve) => curve.run === state.run && isShown(chart, curve) && !chart.hidden.has(curve.name));
    while (chart.dots.length < curves.length) {
      chart.dots.push(element("div", { class: "dot" }));
      chart.plot.parentElement.append(chart.dots.at(-1));
    }
    chart.dots.forEach((dot, k) => {
      if (k >= curves.length) { dot.style.visibility = "hidden"; return; }
      const place = report.between(report.row(abscissa(chart) ? curves[k].x : page.time), state.time);
      dot.style.background = lineColour(curves[k]);
      put(dot, xaxis.d2p(at(xRow(chart, curves[k]), place)), yaxis.d2p(at(report.row(curves[k].y), place)));
    });
  }

  // On paper charts over time are as wide as the page, three of them a page. One that is to keep its proportions is made
  // smaller as a whole where it is wider, and so are parallel coordinates, once they are no wider than their names need.
  function fitToPaper(chart) {
    if (!chart.plot._fullLayout) return;
    const { drawer, equal } = chart.description;
    if (drawer === "parallel") {
      const needed = Math.max(PAPER, parseFloat(chart.plot.style.minWidth));
      Plotly.relayout(chart.plot, { width: Math.min(chart.plot._fullLayout.width, needed) });
    } else if (!equal && !drawer) {
      Plotly.relayout(chart.plot, { width: PAPER, height: LOW, "yaxis.title.font.size": LOW_TITLE });
      chart.plot.parentElement.style.height = `${LOW}px`;
      return;
    }
    const drawn = chart.plot._fullLayout;
    if (drawn.width <= PAPER) return;
    chart.plot.style.zoom = PAPER / drawn.width;
    chart.plot.parentElement.style.height = `${Math.ceil(drawn.height * PAPER / drawn.width) + 2}px`;
  }

  // Charts in view now, others when they come into view.
  function refresh() {
    for (const chart of all) chart.stale = true;
    return window.Plotly && Promise.all(all.filter((chart) => chart.inView).map(draw));
  }

  function make(description) {
    const plot = element("div", { style: "width:100%;height:100%" });
    const kind = description.drawer ? ` own ${description.drawer}` : description.equal ? " square" : "";
    const holder = element("div", { class: `plot${kind}`, role: "img", "aria-label": `${description.title}: ${[].concat(description.y)[0]} over ${description.x}` }, plot);
    const chart = { description, plot, choice: 0, picked: description.pickers.map((picker) => picker.chosen), hidden: new Set(), dots: [], drawn: false, stale: true, inView: false };
    const header = element("header", {}, element("h3", {}, description.title));
    if (description.choices.length) {
      const select = element("select", { "aria-label": `${description.title}: ${description.choosing}` });
      description.choices.forEach((name, k) => select.append(new Option(name, k)));
      select.addEventListener("change", () => { chart.choice = Number(select.value); draw(chart); });
      header.append(select);
    }
    description.pickers.forEach((picker, k) => {
      const select = element("select", { "aria-label": `${description.title}: ${picker.name}` });
      picker.columns.forEach((column, choice) => select.append(new Option(designs.columnName(column), choice)));
      select.value = String(picker.chosen);
      select.addEventListener("change", () => { chart.picked[k] = Number(select.value); draw(chart); });
      header.append(element("label", {}, element("span", {}, picker.name), select));
    });
    chart.cursor = element("div", { class: "cursor" });
    holder.append(chart.cursor);
    chart.legend = element("div", { class: "legend", role: "group", "aria-label": `Curves of ${description.title}` });
    const note = description.note ? [element("figcaption", { class: "note" }, description.note)] : [];
    chart.figure = element("figure", { class: "card chart", id: `chart-${description.identity}` }, header, holder, chart.legend, ...note);
    all.push(chart);
    return chart.figure;
  }

  function start() {
    const holders = [...page.survey.map((panel) => [panel, "survey"]), ...page.panels.map((panel) => [panel, "panels"])];
    for (const [panel, place] of holders) {
      const made = panel.charts.map(make);
      const part = element("details", { class: "part", open: "" }, element("summary", {}, element("h2", {}, panel.title)), element("div", { class: "charts" }, ...made.splice(0, MOST_OPEN)));
      document.getElementById(place).append(part);
      if (made.length) part.append(element("details", { class: "more" },
        element("summary", {}, `${made.length} more charts: ${made.map((figure) => figure.querySelector("h3").textContent).join(", ")}`), element("div", { class: "charts" }, ...made)));
    }
    const byFigure = new Map(all.map((chart) => [chart.figure, chart]));
    const watch = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const chart = byFigure.get(entry.target);
        chart.inView = entry.isIntersecting;
        if (chart.inView && chart.stale && window.Plotly) draw(chart);
      }
    }, { rootMargin: "150px" });
    for (const chart of all) watch.observe(chart.figure);
    // The window may have another width than when a part was folded.
    addEventListener("toggle", ({ target }) => {
      for (const { plot, figure, drawn } of all) if (target.open && drawn && target.contains(figure) && plot.offsetWidth) Plotly.Plots.resize(plot);
    }, true);
    report.on("run", refresh);
    report.on("theme", refresh);
    report.on("over", refresh);
    report.on("time", () => { for (const chart of all) if (chart.inView) moveCursor(chart); });
    addEventListener("beforeprint", () => {
      if (!window.Plotly) return;
      for (const chart of all) if (chart.stale) draw(chart);
      for (const chart of all) fitToPaper(chart);
    });
    addEventListener("afterprint", () => {
      for (const chart of all) chart.plot.style.zoom = chart.plot.parentElement.style.height = "";
      refresh();
      for (const { plot, drawn } of all) {
        if (!drawn) continue;
        // Plotly fits only charts without a size of their own.
        delete plot.layout.width;
        delete plot.layout.height;
        Plotly.Plots.resize(plot);
      }
    });
  }

  return { start, refresh, all };
})();
