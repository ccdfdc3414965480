/* Plots by uPlot with our axes, keys and readings: a frame for all, and lines over the viewing angle. */

import { h, redrawn } from "./dom.js";
import { figure } from "./format.js";
import { colour } from "./palette.js";

const uPlot = window.uPlot;
export const FONT = '12px system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif';

/** The looks that every axis shares, in the colours of the moment. */
export const axisStyle = () => ({
  stroke: colour("axis"),
  font: FONT,
  labelFont: FONT,
  grid: { stroke: colour("grid"), width: 1 },
  ticks: { stroke: colour("grid"), width: 1 },
});

/** A plot in a box that takes the focus, with a line below it that says what is pointed at. */
export class Plot {
  #hidden = new Set();
  #stop;

  /** `options`: height, describe (for people who do not see it), hint (what the line below says at rest). */
  constructor(options) {
    this.options = { height: 330, ...options };
    this.chart = null;
    this.box = h("div", {
      class: "plot",
      role: "img",
      "aria-label": this.options.describe,
      tabindex: "0",
      onkeydown: (e) => this.chart && this.onkey(e),
    });
    this.readout = h("p", { class: "readout", "aria-live": "polite" }, this.options.hint ?? "");
    this.element = h("div", { class: "plot-with-readout" }, this.box, this.readout);
    this.#stop = redrawn(this.box, () => this.draw());
  }

  set(options) {
    Object.assign(this.options, options);
    this.draw();
  }

  /** Show or hide the lines or points of a group. */
  toggle(group, visible) {
    if (visible) this.#hidden.delete(group);
    else this.#hidden.add(group);
    this.draw();
  }

  shows(group) {
    return !this.#hidden.has(group);
  }

  /** Draw anew what `made()` of the kind of plot gives: uPlot's data and settings. */
  draw() {
    if (!this.box.clientWidth) return;
    this.chart?.destroy();
    this.box.replaceChildren();
    const { data, settings } = this.made();
    const frame = { width: this.box.clientWidth, height: this.options.height, legend: { show: false } };
    this.chart = new uPlot({ ...frame, ...settings }, data, this.box);
  }

  destroy() {
    this.#stop();
    this.chart?.destroy();
  }
}

/** Lines or sets of points over the viewing angle: {group, label, x, y, stroke, points, dash, hollow, measured}. */
export class AnglePlot extends Plot {
  /**
   * `lines()` gives what is drawn, in the colours of the moment; more `options`: label (of the y axis), log,
   * symmetric, format, sync (a key that plots share).
   */
  constructor(lines, options) {
    super({ log: false, ...options });
    this.lines = lines;
  }

  made() {
    this.drawn = this.lines().filter((line) => this.shows(line.group));
    const { log } = this.options;
    const tables = this.drawn.map((l) => [l.x, l.y.map((v) => (log && !(v > 0) ? null : v))]);
    const data = tables.length ? uPlot.join(tables) : [[0], []];
    return { data, settings: this.#settings(data) };
  }

  #settings(data) {
    const { log, label, symmetric, sync } = this.options;
    const axis = axisStyle();
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
  onkey(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity }[event.key];
    if (!step) return;
    event.preventDefault();
    const x = this.chart.data[0];
    const idx = Math.min(
      Math.max((this.chart.cursor.idx ?? Math.floor(x.length / 2)) + step, 0),
      x.length - 1,
    );
    this.chart.setCursor({ left: this.chart.valToPos(x[idx], "x"), top: 10 });
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

/** Buttons that show and hide groups of plots: [{group, label, stroke(), outline}]; `outline` clips the dot. */
export function legend(words, groups, plots) {
  return h(
    "div",
    { class: "legend", role: "group", "aria-label": words },
    groups.map(({ group, label, stroke, outline = null }) => {
      const dot = h("span", { class: "dot", "aria-hidden": "true" });
      dot.style.background = stroke();
      if (outline) dot.style.clipPath = outline;
      const button = h(
        "button",
        {
          type: "button",
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

/** What signs of a plot mean: [words, sign] pairs; a sign is an element, or the dashes of a line. */
export function keys(pairs) {
  return h(
    "p",
    { class: "keys" },
    pairs.map(([words, sign]) => h("span", {}, typeof sign === "string" ? line(sign) : sign, words)),
  );
}

function line(dashes) {
  const [svg, path] = ["svg", "path"].map((tag) =>
    document.createElementNS("http://www.w3.org/2000/svg", tag),
  );
  const looks = { d: "M0 5H26", stroke: "currentColor", "stroke-width": "2", "stroke-dasharray": dashes };
  Object.entries(looks).forEach(([name, value]) => path.setAttribute(name, value));
  svg.append(path);
  return svg;
}
