// Elements of the page, and numbers as they are shown.
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

// A button; its title is also its name where its text is a symbol.
export const button = (text, title, onclick, attributes = {}) =>
  element("button", { type: "button", title, "aria-label": /[a-z]{3}/i.test(text) ? null : title, onclick, ...attributes }, text);

// Prefixes of SI units from the smallest to the largest, and the units that take them.
const PREFIXES = [[1e-9, "n"], [1e-6, "µ"], [1e-3, "m"], [1, ""], [1e3, "k"], [1e6, "M"], [1e9, "G"]];
const PREFIXED = ["m", "N", "N m", "Pa", "Hz", "s", "J", "W", "m/N", "N/m", "rad/s"];

// A number in few digits with its unit: 0.0123 m is "12.3 mm"; an empty text for one that is not known.
export function quantity(value, unit = "", digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "";
  if (!PREFIXED.includes(unit) || value === 0) return `${+value.toPrecision(digits)} ${unit}`.trim();
  const size = Math.abs(value);
  const [factor, prefix] = PREFIXES.findLast(([one]) => size >= one * 0.99999) ?? PREFIXES[0];
  return `${+(value / factor).toPrecision(digits)} ${prefix}${unit}`;
}

export const degrees = (value, digits = 4) => (Number.isFinite(value) ? `${+((180 / Math.PI) * value).toPrecision(digits)}°` : "");
