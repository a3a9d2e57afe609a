// Places of names: each beside what it names, where it covers least of the others, of symbols and of links.
const GAPS = [7, 16, 30, 46], DIRECTIONS = [0.6, 0, -0.6, Math.PI / 2, -Math.PI / 2, Math.PI - 0.6, Math.PI, Math.PI + 0.6];

// Gives each label {text, key, x, y, wide, clear} its middle `at` and distance `gap` in pixels; `stands` keeps choices by key.
export function placeNames(labels, taken, stands, width, height) {
  const boxes = [], high = 7;
  for (const one of labels) {
    const wide = one.wide / 2 + 2;
    let least = Infinity;
    GAPS.forEach((gap, far) => DIRECTIONS.forEach((angle, k) => {
      const c = Math.cos(angle), s = Math.sin(angle);
      const edge = Math.min(Math.abs(c) > 1e-9 ? wide / Math.abs(c) : Infinity, Math.abs(s) > 1e-9 ? high / Math.abs(s) : Infinity);
      const away = edge + Math.max(gap, (one.clear ?? 0) + 3), x = one.x + away * c, y = one.y - away * s;
      let cost = 3 * far + 0.2 * k;
      for (const [bx, by, half] of boxes) {
        cost += 40 * Math.max(0, Math.min(1, (wide + half - Math.abs(x - bx)) / wide)) * Math.max(0, Math.min(1, 2 - Math.abs(y - by) / high));
      }
      for (const [tx, ty] of taken) if (Math.abs(x - tx) < wide + 2 && Math.abs(y - ty) < high + 1) cost += 1.5;
      if (x < wide || x > width - wide || y < high || y > height - high) cost += 100;
      const choice = DIRECTIONS.length * far + k;
      if (stands.get(one.key) === choice) cost -= 4;
      if (cost < least) { least = cost; Object.assign(one, { at: [x, y], gap, choice }); }
    }));
    stands.set(one.key, one.choice);
    boxes.push([...one.at, wide]);
  }
}

// Places along a line of pixels, some pixels apart, which names should not cover.
export function alongLine(points) {
  const out = [];
  for (let k = 1; k < points.length; k++) {
    const [x0, y0] = points[k - 1], [x1, y1] = points[k];
    const steps = Math.min(Math.ceil(Math.hypot(x1 - x0, y1 - y0) / 8) || 1, 200);
    for (let step = 0; step <= steps; step++) out.push([x0 + (x1 - x0) * step / steps, y0 + (y1 - y0) * step / steps]);
  }
  return out;
}
