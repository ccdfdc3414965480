/* Marks of groups of points, told apart without colours too. */

const round = (corners, turn = 0) =>
  Array.from({ length: corners }, (_, k) => {
    const angle = (2 * Math.PI * k) / corners + turn;
    return [Math.sin(angle), -Math.cos(angle)];
  });
const PLUS = [
  [-1, -3],
  [1, -3],
  [1, -1],
  [3, -1],
  [3, 1],
  [1, 1],
  [1, 3],
  [-1, 3],
  [-1, 1],
  [-3, 1],
  [-3, -1],
  [-1, -1],
].map(([x, y]) => [0.37 * x, 0.37 * y]);
const CROSS = PLUS.map(([x, y]) => [(x - y) * Math.SQRT1_2, (x + y) * Math.SQRT1_2]);

// Corners about the middle, of about the same area each; none: a circle.
const SHAPES = [
  null,
  round(4, Math.PI / 4).map(([x, y]) => [1.25 * x, 1.25 * y]),
  round(4).map(([x, y]) => [1.3 * x, 1.3 * y]),
  round(3).map(([x, y]) => [1.3 * x, 1.3 * y + 0.2]),
  round(3, Math.PI).map(([x, y]) => [1.3 * x, 1.3 * y - 0.2]),
  PLUS,
  CROSS,
  round(6).map(([x, y]) => [1.1 * x, 1.1 * y]),
];

const shape = (k) => SHAPES[k % SHAPES.length];

/** Begin a path around the k-th group's mark; `size` is its radius. */
export function trace(g, k, x, y, size) {
  const corners = shape(k);
  g.beginPath();
  if (!corners) g.arc(x, y, size, 0, 2 * Math.PI);
  else corners.forEach(([u, v], n) => g[n ? "lineTo" : "moveTo"](x + size * u, y + size * v));
  g.closePath();
}

/** The same as a CSS clip-path. */
export function outline(k) {
  const corners = shape(k);
  const share = (u) => `${(50 + 38 * u).toFixed(1)}%`;
  return corners ? `polygon(${corners.map(([u, v]) => `${share(u)} ${share(v)}`).join(", ")})` : null;
}
