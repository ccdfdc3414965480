/* Line plots over the viewing angle: uPlot with our axes, keys and readings. */

import { h, redrawn } from "./dom.js";
import { figure } from "./format.js";
import { colour } from "./palette.js";

const uPlot = window.uPlot;
const FONT = '12px system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif';

/** One line or set of points: {group, label, x, y, stroke, points, dash, hollow, measured}. */
export class AnglePlot {
  #chart = null;
  #hidden = new Set();
  #stop;

  /**
   * `lines()` gives what is drawn, in the colours of the moment; `options`: label (of the y axis), log, height,
   * symmetric, sync (a key that plots share), describe (for people who do not see it).
   */
  constructor(lines, options) {
    this.lines = lines;
    this.options = { log: false, height: 330, ...options };
    this.box = h("div", {
      class: "plot",
      role: "img",
      "aria-label": this.options.describe,
      tabindex: "0",
      onkeydown: (e) => this.#key(e),
    });
    this.readout = h("p", { class: "readout", "aria-live": "polite" }, "");
    this.element = h("div", { class: "plot-with-readout" }, this.box, this.readout);
    this.#stop = redrawn(this.box, () => this.draw());
  }

  set(options) {
    Object.assign(this.options, options);
    this.draw();
  }

  /** Show or hide the lines of a group. */
  toggle(group, visible) {
    if (visible) this.#hidden.delete(group);
    else this.#hidden.add(group);
    this.draw();
  }

  shows(group) {
    return !this.#hidden.has(group);
  }

  draw() {
    if (!this.box.clientWidth) return;
    this.#chart?.destroy();
    this.drawn = this.lines().filter((line) => !this.#hidden.has(line.group));
    const { log } = this.options;
    const tables = this.drawn.map((l) => [l.x, l.y.map((v) => (log && !(v > 0) ? null : v))]);
    const data = tables.length ? uPlot.join(tables) : [[0], []];
    this.box.replaceChildren();
    this.#chart = new uPlot(this.#settings(data), data, this.box);
  }

  destroy() {
    this.#stop();
    this.#chart?.destroy();
  }

  #settings(data) {
    const { log, height, label, symmetric, sync } = this.options;
    const axis = {
      stroke: colour("axis"),
      font: FONT,
      labelFont: FONT,
      grid: { stroke: colour("grid"), width: 1 },
      ticks: { stroke: colour("grid"), width: 1 },
    };
    const [least, high] = extent(data.slice(1), log);
    // A model may fall to 1e-30 where nothing was measured, which is no reason to show it.
    const measured = this.drawn.filter((line) => line.measured);
    const seen = measured.length
      ? extent(
          measured.map((line) => line.y),
          log,
        )[0]
      : least;
    const low = log ? Math.max(least, seen / 30, high * 1e-9) : least;
    return {
      width: this.box.clientWidth,
      height,
      legend: { show: false },
      cursor: {
        drag: { x: true, y: false },
        points: { size: 7 },
        ...(sync ? { sync: { key: sync, setSeries: false } } : {}),
      },
      scales: {
        x: {
          time: false,
          range: (_, from, to) => (from <= data[0][0] && to >= data[0].at(-1) ? [-90, 90] : [from, to]),
        },
        y: log
          ? { distr: 3, range: [low / 1.3, high * 1.3] }
          : {
              range: symmetric
                ? [-symmetric, symmetric]
                : [Math.min(0, low), high + 0.05 * (high - Math.min(0, low)) || 1],
            },
      },
      axes: [
        {
          ...axis,
          label: "theta_o [°], negative on the side of the light",
          labelSize: 22,
          size: 34,
          values: (_, ticks) => ticks.map((t) => `${t}`),
          incrs: [1, 2, 5, 10, 15, 30, 45],
        },
        {
          ...axis,
          label,
          labelSize: 20,
          size: 58,
          ...(symmetric ? { splits: () => [-1, -0.5, 0, 0.5, 1].map((share) => share * symmetric) } : {}),
          values: (_, ticks) => ticks.map((t) => (t === null ? "" : (this.options.format ?? figure)(t))),
        },
      ],
      series: [
        {},
        ...this.drawn.map((line) => ({
          label: line.label,
          stroke: line.stroke,
          width: line.points ? 0 : (line.width ?? 1.8),
          dash: line.dash,
          spanGaps: true,
          paths: line.points ? () => null : undefined,
          points: line.points
            ? {
                show: true,
                size: line.size ?? 5.5,
                width: 1.2,
                stroke: line.stroke,
                fill: line.hollow ? colour("surface") : line.stroke,
              }
            : { show: false },
        })),
      ],
      hooks: { setCursor: [(chart) => this.#read(chart)] },
    };
  }

  #read(chart) {
    const { idx } = chart.cursor;
    if (idx === null || idx === undefined) {
      this.readout.textContent = this.options.hint ?? "";
      return;
    }
    const at = chart.data[0][idx];
    const said = this.drawn
      .map((line, k) => [line, nearest(chart.data, k + 1, idx)])
      .filter(([, value]) => value !== null)
      .slice(0, 8)
      .map(([line, value]) => `${line.label} ${(this.options.format ?? figure)(value)}`);
    this.readout.textContent = `theta_o ${Number(at.toFixed(2))}°: ${said.join(" · ")}`;
  }

  /** Arrow keys move the cursor, so that readings need no pointer. */
  #key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity }[event.key];
    if (!step || !this.#chart) return;
    event.preventDefault();
    const x = this.#chart.data[0];
    const idx = Math.min(
      Math.max((this.#chart.cursor.idx ?? Math.floor(x.length / 2)) + step, 0),
      x.length - 1,
    );
    this.#chart.setCursor({ left: this.#chart.valToPos(x[idx], "x"), top: 10 });
  }
}

/** The value of a series at a place of the common axis, or beside it within 1.5 degrees. */
function nearest(data, series, idx) {
  const x = data[0];
  for (let step = 0; step < x.length; step += 1) {
    const near = [idx - step, idx + step].filter(
      (k) => k >= 0 && k < x.length && Math.abs(x[k] - x[idx]) <= 1.5,
    );
    if (!near.length) return null;
    for (const k of near) {
      const value = data[series][k];
      if (value !== null && value !== undefined) return value;
    }
  }
  return null;
}

function extent(rows, positive) {
  let low = Infinity;
  let high = -Infinity;
  for (const row of rows) {
    for (const v of row) {
      if (v === null || v === undefined || !Number.isFinite(v) || (positive && v <= 0)) continue;
      low = Math.min(low, v);
      high = Math.max(high, v);
    }
  }
  return low <= high ? [low, high] : [positive ? 0.1 : 0, 1];
}

/** Buttons that show and hide groups of a plot's lines: [{group, label, stroke()}]. */
export function legend(groups, plots) {
  return h(
    "div",
    { class: "legend", role: "group", "aria-label": "Incidences shown" },
    groups.map(({ group, label, stroke }) => {
      const dot = h("span", { class: "dot", "aria-hidden": "true" });
      dot.style.background = stroke();
      const button = h(
        "button",
        {
          type: "button",
          "aria-pressed": plots[0].shows(group),
          onclick: () => {
            const visible = !plots[0].shows(group);
            plots.forEach((plot) => plot.toggle(group, visible));
            button.setAttribute("aria-pressed", visible);
          },
        },
        dot,
        label,
      );
      button.setAttribute("aria-pressed", plots[0].shows(group));
      return button;
    }),
  );
}
