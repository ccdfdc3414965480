/* Residuals over both angles: where a model is too bright or too dark. */

import { card, fill, h, redrawn, sharp } from "./dom.js";
import { percent } from "./format.js";
import { colour, diverging } from "./palette.js";
import { problemCard } from "./problem.js";

const PAD = { left: 46, right: 12, top: 8, bottom: 40 };
// Columns are as wide as the readings stand apart, within these bounds in degrees.
const COLUMNS = [1, 10];
const ROWS = 30;

export function residualCard(view, compared) {
  const box = h("div", { class: "stack" }, h("p", { class: "note" }, "Drawing …"));
  let stops = [];
  const clear = () => {
    stops.forEach((stop) => stop());
    stops = [];
  };
  view.atEnd(clear);
  async function load() {
    try {
      const models = await Promise.all(
        compared.models.map(async ([which, name]) => [
          which,
          name,
          gridOf((await compared.curves(name)).residuals, compared.channel),
        ]),
      );
      const limit = scale(models.map(([, , grid]) => grid));
      clear();
      const maps = models.map(([which, name, grid]) => {
        const map = new ResidualMap(`${which.toUpperCase()} ${name}`, grid, limit);
        stops.push(map.stop);
        return map.element;
      });
      fill(box, h("div", { class: "halves" }, maps), scaleBar(limit, stops));
    } catch (error) {
      fill(box, problemCard(error));
    }
  }
  compared.onchange(load);
  load();
  return card(
    "Residuals over the angles",
    {
      id: "residuals",
      note: "Measured over model, less one, averaged over cells; azimuths outside the plane are folded in.",
    },
    box,
  );
}

/** Average relative residuals into cells of theta_i (measured ones, or bands) and signed theta_o. */
export function gridOf(residuals, channel) {
  const thetas = [...new Set(residuals.theta_i_deg.map((t) => Math.round(t * 100) / 100))].sort(
    (a, b) => a - b,
  );
  const rows =
    thetas.length <= ROWS ? thetas : Array.from({ length: ROWS }, (_, k) => ((k + 0.5) * 90) / ROWS);
  const width = apart(residuals.theta_o_deg);
  const cells = new Map();
  residuals.theta_i_deg.forEach((theta, n) => {
    const value = residuals.relative[channel][n];
    if (value === null) return;
    const row =
      thetas.length <= ROWS ? nearestIn(rows, theta) : Math.min(Math.floor((theta * ROWS) / 90), ROWS - 1);
    const column = Math.round(residuals.theta_o_deg[n] / width);
    const cell = cells.get(`${row},${column}`) ?? { row, column, sum: 0, count: 0 };
    cell.sum += value;
    cell.count += 1;
    cells.set(`${row},${column}`, cell);
  });
  return {
    rows,
    width,
    cells: [...cells.values()].map((c) => ({
      row: c.row,
      column: c.column,
      value: c.sum / c.count,
      count: c.count,
    })),
  };
}

/** The usual distance between neighbouring viewing angles. */
function apart(angles) {
  const there = [...new Set(angles.map((angle) => Math.round(Math.abs(angle) * 10)))].sort((a, b) => a - b);
  const gaps = there
    .slice(1)
    .map((angle, k) => (angle - there[k]) / 10)
    .sort((a, b) => a - b);
  const usual = gaps[Math.floor(gaps.length / 2)] ?? COLUMNS[1];
  return Math.min(Math.max(usual, COLUMNS[0]), COLUMNS[1]);
}

function nearestIn(rows, theta) {
  return rows.reduce((best, t, k) => (Math.abs(t - theta) < Math.abs(rows[best] - theta) ? k : best), 0);
}

/** A round limit that holds nearly all cells. */
function scale(grids) {
  const sizes = grids.flatMap((g) => g.cells.map((c) => Math.abs(c.value))).sort((a, b) => a - b);
  const most = sizes[Math.floor(0.95 * (sizes.length - 1))] ?? 0.1;
  return [0.05, 0.1, 0.2, 0.5, 1].find((limit) => limit >= most) ?? 1;
}

class ResidualMap {
  #at = null;

  constructor(title, grid, limit) {
    Object.assign(this, { grid, limit });
    this.canvas = h("canvas", {
      role: "img",
      tabindex: "0",
      "aria-label": `Residual map of ${title}. Arrow keys read cells.`,
      onpointermove: (e) => this.#point(e),
      onpointerleave: () => this.#choose(null),
      onkeydown: (e) => this.#key(e),
    });
    this.readout = h("p", { class: "readout", "aria-live": "polite" });
    this.box = h("div", { class: "plot" }, this.canvas);
    this.element = h("div", {}, h("h3", {}, title), this.box, this.readout);
    this.stop = redrawn(this.box, () => this.draw());
    this.#choose(null);
  }

  draw() {
    const width = this.box.clientWidth;
    if (!width) return;
    const height = 250;
    const g = sharp(this.canvas, width, height);
    const { rows, cells } = this.grid;
    Object.assign(this, {
      plot: { x: PAD.left, y: PAD.top, w: width - PAD.left - PAD.right, h: height - PAD.top - PAD.bottom },
    });
    const { x, y, w, h: tall } = this.plot;
    g.fillStyle = colour("sunken");
    g.fillRect(x, y, w, tall);
    for (const cell of cells) {
      g.fillStyle = diverging(cell.value / this.limit);
      const [cx, cy, cw, ch] = this.#rect(cell);
      g.fillRect(cx, cy + 0.5, cw + 0.4, ch - 1);
    }
    g.font = '12px system-ui, "DejaVu Sans", sans-serif';
    g.fillStyle = colour("axis");
    g.textAlign = "center";
    for (let angle = -90; angle <= 90; angle += 30)
      g.fillText(`${angle}`, x + ((angle + 90) / 180) * w, y + tall + 15);
    g.fillText("theta_o [°]", x + w / 2, y + tall + 33);
    g.textAlign = "right";
    const every = Math.ceil(rows.length / 10);
    rows.forEach((theta, row) => {
      if (row % every === 0)
        g.fillText(
          `${Math.round(theta * 10) / 10}°`,
          x - 6,
          y + tall - ((row + 0.5) * tall) / rows.length + 4,
        );
    });
    if (this.#at) {
      g.strokeStyle = colour("ink");
      g.lineWidth = 2;
      const [cx, cy, cw, ch] = this.#rect(this.#at);
      g.strokeRect(cx - 1, cy, cw + 2, ch);
    }
  }

  #rect({ row, column }) {
    const { x, y, w, h: tall } = this.plot;
    const size = tall / this.grid.rows.length;
    const left = x + (((column - 0.5) * this.grid.width + 90) / 180) * w;
    return [left, y + tall - (row + 1) * size, (this.grid.width / 180) * w, size];
  }

  #point(event) {
    const { x, y, w, h: tall } = this.plot;
    const bounds = this.canvas.getBoundingClientRect();
    const column = Math.round((((event.clientX - bounds.left - x) / w) * 180 - 90) / this.grid.width);
    const row = Math.floor(((tall - (event.clientY - bounds.top - y)) / tall) * this.grid.rows.length);
    this.#choose(this.grid.cells.find((c) => c.row === row && c.column === column) ?? null);
  }

  #key(event) {
    const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 0], ArrowDown: [-1, 0] }[event.key];
    if (!step) return;
    event.preventDefault();
    const from = this.#at ?? this.grid.cells[0];
    const [up, along] = step;
    // The nearest cell in that direction; gaps in the data are stepped over.
    const ahead = this.grid.cells.filter((c) =>
      up ? (c.row - from.row) * up > 0 : c.row === from.row && (c.column - from.column) * along > 0,
    );
    const far = (c) => Math.abs(c.row - from.row) * 1000 + Math.abs(c.column - from.column);
    this.#choose(ahead.sort((a, b) => far(a) - far(b))[0] ?? from);
  }

  #choose(cell) {
    this.#at = cell;
    const sizes = this.grid.cells.map((c) => Math.abs(c.value)).sort((a, b) => a - b);
    this.readout.textContent = cell
      ? `theta_i ${Math.round(this.grid.rows[cell.row] * 10) / 10}°, theta_o ${Math.round(cell.column * this.grid.width * 10) / 10}°: measured ${percent(Math.abs(cell.value))} ${cell.value < 0 ? "below" : "above"} the model${cell.count > 1 ? ` (mean of ${cell.count})` : ""}`
      : `Half of the cells are within ${percent(sizes[Math.floor(sizes.length / 2)] ?? 0)}. Rows are theta_i.`;
    this.draw();
  }
}

function scaleBar(limit, stops) {
  const canvas = h("canvas", {
    role: "img",
    "aria-label": `Colours from ${percent(-limit)} to ${percent(limit)}`,
  });
  const box = h("div", { class: "plot" }, canvas);
  stops.push(
    redrawn(box, (width) => {
      const wide = Math.min(width, 420);
      const left = (width - wide) / 2;
      const g = sharp(canvas, width, 32);
      for (let k = 0; k < wide; k += 1) {
        g.fillStyle = diverging((2 * k) / wide - 1);
        g.fillRect(left + k, 0, 1.5, 12);
      }
      g.fillStyle = colour("axis");
      g.font = '12px system-ui, "DejaVu Sans", sans-serif';
      for (const [place, words, align] of [
        [0, `${percent(limit)} below the model`, "left"],
        [0.5, "0", "center"],
        [1, `${percent(limit)} above`, "right"],
      ]) {
        g.textAlign = align;
        g.fillText(words, left + place * wide, 27);
      }
    }),
  );
  return box;
}
