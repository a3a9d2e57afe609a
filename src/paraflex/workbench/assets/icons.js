// Icons of the tools, 24 by 24: lines, and filled parts.
const dot = (x, y, r = 2.2) => `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;

const ICONS = {
  select: ["M6 4V19L10 15.2L12.8 21L15.4 19.8L12.7 14.2H18Z"],
  shape: [`${dot(6, 18)}M7.8 16.2L15 9M12 5.5L18.5 5.5V12M15 9L18.5 5.5`],
  ground: [`M12 6L6.5 15H17.5ZM4 15H20M5 19L7.5 15M10 19L12.5 15M15 19L17.5 15`, dot(12, 6)],
  link: [`${dot(5.5, 18.5, 2.5)}${dot(18.5, 5.5, 2.5)}M7.4 16.6L16.6 7.4`],
  beam: [`${dot(5.5, 18.5, 2.5)}${dot(18.5, 5.5, 2.5)}M5.6 15.9C6 9 10 6 15.9 5.6M8.1 18.4C14 18 18 14 18.4 8.1`],
  plate: [`M12 6L5.5 18H18.5Z${dot(12, 5)}${dot(5, 18.5)}${dot(19, 18.5)}`],
  point: ["M3 17L21 7", dot(12, 12, 2.6)],
  revolute: [dot(12, 12, 6.5), dot(12, 12, 2.2)],
  slider: ["M3 17H21M7 8.5H17V15.5H7Z", dot(12, 12, 1.6)],
  weld: ["M4 12H20M12 4V12", "M7 12L12 6.5L17 12Z"],
  motor: [`${dot(12, 12, 8)}M8.5 15.5V8.5L12 13L15.5 8.5V15.5`],
  drive: ["M18.5 12A6.5 6.5 0 1 1 12 5.5M12 2.5L15.5 5.5L12 8.5", dot(12, 12, 1.8)],
  gear: [`${dot(8, 14.5, 5)}${dot(17, 8, 3.4)}`, `${dot(8, 14.5, 1.3)}${dot(17, 8, 1.3)}`],
  spring: ["M2.5 12H5L7 7L10 17L13 7L16 17L18.5 12H21.5"],
  damper: ["M2.5 12H9M9 7.5V16.5M6.5 6H15V18H6.5M15 12H21.5"],
  load: ["M4 20L18.5 5.5M11 5H19V13"],
  lump: [dot(12, 12, 7), dot(12, 12, 4)],
  sensor: ["M4 17A8 8 0 1 1 20 17M12 17L16 9.5", dot(12, 17, 1.6)],
  effector: [`${dot(12, 12, 5.5)}M12 3V9M12 15V21M3 12H9M15 12H21`],
  path: ["M4 18L9 7L15 14L20 6", `${dot(4, 18, 1.8)}${dot(9, 7, 1.8)}${dot(15, 14, 1.8)}${dot(20, 6, 1.8)}`],
};

export function icon(name) {
  const space = "http://www.w3.org/2000/svg", made = document.createElementNS(space, "svg");
  for (const [key, value] of [["viewBox", "0 0 24 24"], ["aria-hidden", "true"], ["class", "icon"]]) made.setAttribute(key, value);
  ICONS[name].forEach((line, k) => {
    const path = document.createElementNS(space, "path");
    path.setAttribute("d", line);
    path.setAttribute("class", k ? "full" : "line");
    made.append(path);
  });
  return made;
}
