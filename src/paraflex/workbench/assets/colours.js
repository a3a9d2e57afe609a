// Theme of the page: light, dark or that of the system, kept for the next time.
const DARK = matchMedia("(prefers-color-scheme: dark)");

export class Colours {
  constructor(root) {
    this.root = root;
    this.known = new Map();
    this.listeners = [];
    let kept = "auto";
    try { kept = localStorage.getItem("paraflex-theme") || "auto"; } catch { /* a notebook's storage may be closed */ }
    this.root.dataset.theme = kept;
    DARK.addEventListener("change", () => this.changed());
  }

  get isDark() { return this.root.dataset.theme === "auto" ? DARK.matches : this.root.dataset.theme === "dark"; }

  set(name) {
    this.root.dataset.theme = name;
    try { localStorage.setItem("paraflex-theme", name); } catch { /* as above */ }
    this.changed();
  }

  changed() {
    this.known.clear();
    for (const listener of this.listeners) listener();
  }

  // A colour by its name in the style sheet.
  of(name) {
    if (!this.known.has(name)) this.known.set(name, getComputedStyle(this.root).getPropertyValue(`--${name}`).trim());
    return this.known.get(name);
  }

  link(number) { return this.of(`link${number % 8}`); }
}
