// Selection, theme and keys; then everything is begun.
const begin = (() => {
  const { page, state, element } = report;
  const byId = (name) => document.getElementById(name);
  const MOST_BUTTONS = 12;

  function selectRun(run) {
    report.set("run", (run + page.runs.length) % page.runs.length);
  }

  function showRun() {
    for (const row of document.querySelectorAll("tr[data-run]")) row.classList.toggle("selected", Number(row.dataset.run) === state.run);
    for (const part of document.querySelectorAll(".of-run")) part.classList.toggle("other", Number(part.dataset.ofRun) !== state.run);
    for (const button of document.querySelectorAll("tr[data-run] .pick")) button.setAttribute("aria-pressed", String(Number(button.closest("tr").dataset.run) === state.run));
    if (page.groups.length && page.runs.length > 1) showGroup();
    const radio = document.querySelector(`#runs input[value="${state.run}"]`);
    if (radio) {
      radio.checked = true;
      const holder = byId("runs"), chip = radio.parentElement;
      holder.scrollLeft = chip.offsetLeft - holder.offsetLeft - (holder.clientWidth - chip.offsetWidth) / 2;
    }
    const select = byId("run");
    if (select) select.value = String(state.run);
    byId("canvas").setAttribute("aria-label", `The mechanism in motion${report.runName() ? `, ${page.selecting} ${report.runName()}` : ""}`);
  }

  // The runs of a group as buttons, chosen after the group.
  const firstOf = (group) => page.groups.slice(0, group).reduce((sum, [, count]) => sum + count, 0);
  const groupOf = (run) => page.groups.findIndex(([, count], group) => run < firstOf(group) + count);

  function showGroup() {
    const holder = byId("members"), group = groupOf(state.run);
    byId("group").value = String(group);
    if (holder.dataset.group === String(group)) return;
    holder.dataset.group = String(group);
    holder.replaceChildren();
    addButtons(holder, firstOf(group), page.groups[group][1]);
  }

  function addButtons(holder, first, count) {
    for (let k = first; k < first + count; k++) {
      const radio = element("input", { type: "radio", name: "run", value: k });
      radio.addEventListener("change", () => selectRun(k));
      holder.append(element("label", {}, radio, page.groups.length ? page.runs[k].split(": ").at(-1) : page.runs[k]));
    }
  }

  function makeSelector() {
    const holder = byId("runs");
    if (page.runs.length < 2) { holder.hidden = byId("key-run").hidden = true; return; }
    holder.querySelector("legend").textContent = page.selecting;
    if (page.groups.length) {
      const select = element("select", { id: "group", "aria-label": "motors" });
      page.groups.forEach(([name], k) => select.append(new Option(name, k)));
      select.addEventListener("change", () => selectRun(firstOf(Number(select.value))));
      holder.append(select, element("span", { id: "members", style: "display: contents" }));
    } else if (page.runs.length > MOST_BUTTONS) {
      const select = element("select", { id: "run", "aria-label": page.selecting });
      page.runs.forEach((name, k) => select.append(new Option(name, k)));
      select.addEventListener("change", () => selectRun(Number(select.value)));
      holder.append(select);
    } else {
      addButtons(holder, 0, page.runs.length);
    }
    for (const row of document.querySelectorAll("tr[data-run]")) row.addEventListener("click", () => selectRun(Number(row.dataset.run)));
    report.on("run", () => {
      showRun();
      byId("announcement").textContent = `${page.selecting} ${report.runName()}`;
    });
  }

  function makeOver() {
    const select = byId("over");
    byId("has-over").hidden = !page.abscissae.length;
    ["time", ...page.abscissae.map((one) => one.name)].forEach((name, k) => select.append(new Option(name, k)));
    select.value = report.state.over;
    select.addEventListener("change", () => report.set("over", Number(select.value)));
  }

  function makeTheme() {
    const button = byId("theme"), names = ["auto", "light", "dark"];
    const show = () => {
      const name = document.documentElement.dataset.theme;
      button.textContent = { auto: "◐ auto", light: "☀ light", dark: "☾ dark" }[name];
      button.setAttribute("aria-label", `Theme: ${name}`);
    };
    button.addEventListener("click", () => {
      report.setTheme(names[(names.indexOf(document.documentElement.dataset.theme) + 1) % names.length]);
    });
    report.on("theme", show);
    show();
    // Paper is white.
    let before = null;
    let folded = [];
    addEventListener("beforeprint", () => { folded = [...document.querySelectorAll("details:not([open])")]; for (const one of folded) one.open = true; });
    addEventListener("afterprint", () => { for (const one of folded) one.open = false; });
    addEventListener("beforeprint", () => { if (report.isDark()) { before = document.documentElement.dataset.theme; report.setTheme("light", false); } });
    addEventListener("afterprint", () => { if (before) { report.setTheme(before, false); before = null; } });
  }

  function listen() {
    if (!page.panels.length) return;
    const keys = {
      " ": () => player.play(!state.playing),
      ArrowRight: (event) => player.step(event.shiftKey ? 10 : 1),
      ArrowLeft: (event) => player.step(event.shiftKey ? -10 : -1),
      "+": () => player.magnify(1), "=": () => player.magnify(1), "-": () => player.magnify(-1),
      m: () => selectRun(state.run + 1), M: () => selectRun(state.run - 1),
      0: () => player.seek(0), Home: () => player.seek(0), End: () => player.seek(player.end()),
    };
    addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      // Elements with keys of their own keep them.
      const { target } = event;
      const own = target.closest("select, textarea, input:not([type=checkbox])") && !/^[mM+=-]$/.test(event.key);
      const pressed = event.key === " " && target.closest("button, a, input, select, summary");
      const scrolls = /^(Arrow|Home|End)/.test(event.key) && target.closest(".scroll, .runs");
      if (own || pressed || scrolls) return;
      event.preventDefault();
      act(event);
    });
  }

  // What is wider than the screen fades where it goes on; below tables a line says that they scroll.
  function showScrolling() {
    for (const holder of document.querySelectorAll(".scroll, .runs")) {
      const hint = element("p", { class: "swipe", "aria-hidden": "true", hidden: "" }, "the table scrolls sideways →");
      if (holder.matches(".scroll")) holder.before(hint);
      const show = () => {
        const left = holder.scrollWidth - holder.clientWidth;
        hint.hidden = left < 2;
        holder.classList.toggle("goes-on", holder.scrollLeft < left - 2);
        holder.classList.toggle("goes-back", holder.scrollLeft > 2);
      };
      holder.addEventListener("scroll", show, { passive: true });
      new ResizeObserver(show).observe(holder);
      show();
    }
  }

  // A link to a folded part opens it.
  function unfold(hash) {
    const target = byId(decodeURIComponent(hash.slice(1)));
    for (let part = target; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
    if (target && hash === location.hash) target.scrollIntoView();
  }

  function makeLinks() {
    for (const link of document.querySelectorAll('a[href^="#"]')) link.addEventListener("click", () => unfold(link.hash));
    addEventListener("hashchange", () => unfold(location.hash));
    if (location.hash) unfold(location.hash);
  }

  async function loadPlotly(bytes) {
    const script = element("script");
    script.textContent = new TextDecoder().decode(await bytes);
    document.head.append(script);
  }

  async function open() {
    makeSelector();
    makeOver();
    makeTheme();
    makeLinks();
    showScrolling();
    byId("keyed").textContent = page.selecting;
    listen();
    await report.readSeries();
    const time = report.row(page.time);
    report.timeRange = time.length > 1 ? [time[0], time[time.length - 1]] : undefined;
    showRun();
    designs.start();
    charts.start();
    const charted = page.panels.length || page.survey.length;
    // Inflated beside what the animation reads.
    const plotly = charted && report.inflated(byId("plotly").textContent);
    await player.start();
    document.documentElement.dataset.ready = "true";
    performance.mark("ready");
    if (!charted) return;
    // After the screen shows what there is.
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));
    await loadPlotly(plotly);
    await charts.refresh();
    document.documentElement.dataset.charts = "true";
    performance.mark("charts");
  }

  return () => open().catch((error) => {
    const text = typeof DecompressionStream === "undefined" ? "This browser is too old for the charts and the animation." : `The charts cannot be shown: ${error.message}`;
    document.querySelector("main").prepend(element("p", { class: "notice" }, text));
    throw error;
  });
})();
