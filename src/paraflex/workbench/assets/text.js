import { element } from "./elements.js";

const REST = 400; // time without a key after which the text is sent [ms]

// The lines [first, after] of a table or of one of its fields in a text of TOML; null if they are not there.
export function linesOf(text, place) {
  const lines = text.split("\n"), bare = (key) => key.trim().replace(/^["']|["']$/g, "");
  const keysOf = (name) => name.match(/"[^"]*"|'[^']*'|[^.\s]+/g)?.map(bare) ?? [];
  let table = [], best = null, depth = 0;
  for (let k = 0; k < lines.length; k++) {
    const header = /^\s*\[([^\]]+)\]\s*(#.*)?$/.exec(lines[k]), pair = /^\s*((?:"[^"]*"|'[^']*'|[\w.-])+)\s*=/.exec(lines[k]);
    if (header) table = keysOf(header[1]);
    const path = header ? table : pair ? [...table, ...keysOf(pair[1])] : null;
    if (!path) continue;
    let common = 0;
    while (common < path.length && common < place.length && path[common] === String(place[common])) common++;
    if (common === path.length && common > depth && (!header || common <= place.length)) { depth = common; best = [k, header ? endOfTable(lines, k) : endOfPair(lines, k)]; }
    else if (header && common === place.length && !best) best = [k, endOfTable(lines, k)];
  }
  return best;
}

function endOfTable(lines, start) {
  let end = start + 1;
  while (end < lines.length && !/^\s*\[/.test(lines[end])) end++;
  while (end > start + 1 && /^\s*(#.*)?$/.test(lines[end - 1])) end--;
  return end;
}

function endOfPair(lines, start) {
  const depth = (line) => (line.replace(/"[^"]*"|'[^']*'|#.*/g, "").match(/[[{]/g)?.length ?? 0) - (line.replace(/"[^"]*"|'[^']*'|#.*/g, "").match(/[\]}]/g)?.length ?? 0);
  let open = 0, end = start;
  do open += depth(lines[end++]); while (open > 0 && end < lines.length);
  return end;
}

// The text of the file, edited both ways.
export class TextPane {
  constructor(bench) {
    this.bench = bench;
    this.area = element("textarea", { spellcheck: "false", autocapitalize: "off", autocomplete: "off", wrap: "off", "aria-label": "Text of the model file" });
    this.lines = element("div", { class: "lines", "aria-hidden": "true" });
    this.wrong = element("p", { class: "wrong", role: "alert", hidden: true });
    this.panel = element("div", { class: "file" }, this.wrong, element("div", { class: "editor" }, this.lines, this.area));
    this.sent = null;
    bench.addTab("file", "File", this.panel);
    this.area.addEventListener("input", () => this.typed());
    this.area.addEventListener("scroll", () => this.scrolled());
    this.area.addEventListener("keydown", (event) => this.tab(event));
    this.area.addEventListener("blur", () => this.flush());
    this.panel.addEventListener("shown", () => { this.mark(); this.reveal(); });
    bench.on("state", () => this.take());
    bench.on("selected", () => { this.mark(); this.reveal(); });
  }

  typed() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.flush(), REST);
    this.number();
  }

  // Send what was typed; resolves when Python has it.
  async flush() {
    clearTimeout(this.timer);
    if (this.flight) await this.flight;
    if (this.area.value === this.shownText || this.shownText === undefined) return;
    this.sent = this.area.value;
    this.shownText = this.sent;
    this.flight = this.bench.request("text", { text: this.crlf ? this.sent.replaceAll("\n", "\r\n") : this.sent });
    await this.flight;
    this.flight = null;
  }

  // A text that changed elsewhere: only the part that differs is written, so the cursor stays in its line.
  take() {
    const { text } = this.bench.state;
    this.crlf = text.includes("\r\n");
    const next = text.replaceAll("\r\n", "\n"), now = this.area.value, typing = now !== this.shownText && this.shownText !== undefined;
    if (next !== now && !(typing && document.activeElement === this.area)) {
      let from = 0, back = 0;
      while (from < now.length && now[from] === next[from]) from++;
      while (back < Math.min(now.length, next.length) - from && now[now.length - 1 - back] === next[next.length - 1 - back]) back++;
      const { scrollTop } = this.area;
      this.area.setRangeText(next.slice(from, next.length - back), from, now.length - back, "preserve");
      this.area.scrollTop = scrollTop;
      this.changed = from;
    }
    if (!typing || next === this.area.value) this.shownText = this.area.value;
    this.number();
    this.mark();
  }

  number() {
    const count = this.area.value.split("\n").length;
    while (this.lines.childElementCount < count) this.lines.append(element("span", {}, String(this.lines.childElementCount + 1)));
    while (this.lines.childElementCount > count) this.lines.lastChild.remove();
  }

  // Lines of the error, and of what is selected.
  mark() {
    const { problem } = this.bench.state, [chosen] = this.bench.selected;
    this.wrong.hidden = !problem;
    this.wrong.textContent = problem?.text ?? "";
    const text = this.area.value, at = /\bline (\d+)/.exec(problem?.text ?? "");
    const bad = problem && (at ? [+at[1] - 1, +at[1]] : problem.field ? linesOf(text, problem.field.split(".")) : null);
    const own = chosen ? linesOf(text, this.bench.placeOf(chosen)) : null;
    [...this.lines.children].forEach((line, k) => {
      const within = (part) => part && k >= part[0] && k < part[1];
      line.className = within(bad) ? "bad" : within(own) ? "own" : "";
    });
    this.own = own;
  }

  reveal(place) {
    const part = place ? linesOf(this.area.value, place) : this.own;
    if (!part || this.panel.hidden || document.activeElement === this.area) return;
    const high = parseFloat(getComputedStyle(this.area).lineHeight), top = part[0] * high;
    if (top < this.area.scrollTop || top > this.area.scrollTop + this.area.clientHeight - 4 * high) this.area.scrollTop = Math.max(0, top - 4 * high);
    this.scrolled();
  }

  scrolled() { this.lines.style.transform = `translateY(${-this.area.scrollTop}px)`; }

  tab(event) {
    if (event.key === "Escape") this.bench.sheet.canvas.focus();
  }
}
