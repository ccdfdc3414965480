/* Time against error of many choices, both in logarithms, with the Pareto front through the best. */

import { fill, h } from "./dom.js";
import { figure } from "./format.js";
import { colour, grouped } from "./palette.js";
import { axisStyle, FONT, Plot } from "./plots.js";
import { outline, trace } from "./shapes.js";
import { logTicks } from "./ticks.js";

const SIZE = 4.5;
const BOLD = 6.5;
// How far from a point the pointer still means it, in pixels.
const REACH = 26;
const ROOM = 0.06;

/**
 * Points {label, group, x, y, x_low, x_high, y_low, y_high, letter, filled}: those with a letter form the
 * front.
 */
export class ScatterPlot extends Plot {
  #at = null;

  /**
   * More `options`: x_label, y_label, limit ({y, words}: a line across), most (values of y above it stand at
   * the upper edge), tip (gives a point's description, for the box beside it), words (its one line).
   */
  constructor(points, options) {
    super(options);
    this.points = points;
    this.groups = [...new Set(points.map((p) => p.group))];
    this.front = points.filter((p) => p.letter).sort((a, b) => a.x - b.x || b.y - a.y);
    this.tip = h("div", { class: "tip", hidden: true });
    this.spot = h("div", { class: "spot", hidden: true });
    this.box.addEventListener("pointermove", (e) => this.#point(e));
    this.box.addEventListener("pointerdown", (e) => this.#point(e));
    // A finger leaves as soon as it is lifted.
    this.box.addEventListener("pointerleave", (e) => e.pointerType !== "touch" && this.choose(null));
    this.box.addEventListener("blur", () => this.choose(null));
  }

  /** What a legend needs to know of the groups. */
  get keys() {
    return this.groups.map((group, k) => ({
      group,
      label: group,
      stroke: () => grouped(k),
      outline: outline(k),
    }));
  }

  draw() {
    super.draw();
    this.box.append(this.spot, this.tip);
    this.choose(null);
  }

  made() {
    const shown = this.points.map((p) => [p.x, this.#height(p.y)]).sort((a, b) => a[0] - b[0]);
    const [x, y] = [0, 1].map((k) => shown.map((pair) => pair[k]));
    const { x_label, y_label, limit } = this.options;
    const ends = {
      x: reach(this.points.flatMap((p) => [p.x_low, p.x_high])),
      y: reach([
        ...this.points.flatMap((p) => [p.y_low, p.y_high].map((v) => this.#height(v))),
        ...(limit ? [0.9 * limit.y] : []),
      ]),
    };
    // What holds all the data is no zoom.
    const scale = (name, values) => ({
      distr: 3,
      range: (_, from, to) =>
        from <= Math.min(...values) && to >= Math.max(...values) ? ends[name] : [from, to],
    });
    const axis = (label, space, more) => ({
      ...axisStyle(),
      label,
      splits: (chart, _, low, high) =>
        more.side === 3
          ? logTicks(low, this.#height(high), Math.floor(chart.height / space))
          : logTicks(low, high, Math.floor(chart.width / space)),
      filter: (_, ticks) => ticks,
      values: (_, ticks) => ticks.map((t) => figure(t, 2)),
      ...more,
    });
    return {
      data: [x, y],
      settings: {
        cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: true, uni: 30 } },
        scales: { x: { time: false, ...scale("x", x) }, y: scale("y", y) },
        axes: [
          axis(x_label, 62, { side: 2, labelSize: 22, size: 34 }),
          axis(y_label, 30, { side: 3, labelSize: 20, size: 58 }),
        ],
        series: [{}, { paths: () => null, points: { show: false } }],
        hooks: { draw: [(chart) => this.#paint(chart)] },
      },
    };
  }

  #height(y) {
    return Math.min(y, this.options.most ?? Infinity);
  }

  #place(chart, p) {
    return [chart.valToPos(p.x, "x"), chart.valToPos(this.#height(p.y), "y")];
  }

  #drawn(p) {
    return Boolean(p.letter) || this.shows(p.group);
  }

  #paint(chart) {
    const ratio = chart.ctx.canvas.width / chart.width;
    const [left, top, width, height] = ["left", "top", "width", "height"].map((k) => chart.bbox[k] / ratio);
    const g = chart.ctx;
    g.save();
    g.scale(ratio, ratio);
    g.translate(left, top);
    g.beginPath();
    g.rect(0, 0, width, height);
    g.clip();
    g.font = FONT;
    const { limit } = this.options;
    if (limit) this.#across(g, chart.valToPos(limit.y, "y"), width, limit.words);
    const drawn = this.points.filter((p) => this.#drawn(p));
    drawn.forEach((p) => this.#bars(g, chart, p));
    this.#steps(g, chart, width);
    // The front comes last, so that nothing hides it.
    for (const p of [...drawn.filter((q) => !q.letter), ...this.front]) this.#mark(g, chart, p);
    this.#name(g, chart, drawn, [width, height]);
    g.restore();
  }

  #across(g, y, width, words) {
    g.strokeStyle = colour("warm");
    g.fillStyle = colour("warm");
    g.lineWidth = 1;
    g.setLineDash([5, 4]);
    g.beginPath();
    g.moveTo(0, y);
    g.lineTo(width, y);
    g.stroke();
    g.setLineDash([]);
    g.textAlign = "right";
    g.fillText(words, width - 4, y + 15);
  }

  #bars(g, chart, p) {
    const [x, y] = this.#place(chart, p);
    g.strokeStyle = grouped(this.groups.indexOf(p.group));
    g.globalAlpha = p.letter ? 0.9 : 0.6;
    g.lineWidth = 1;
    g.beginPath();
    g.moveTo(chart.valToPos(p.x_low, "x"), y);
    g.lineTo(chart.valToPos(p.x_high, "x"), y);
    g.moveTo(x, chart.valToPos(this.#height(p.y_low), "y"));
    g.lineTo(x, chart.valToPos(this.#height(p.y_high), "y"));
    g.stroke();
    g.globalAlpha = 1;
  }

  /** Whoever waits no longer than until the next point of the front gets no better than the last. */
  #steps(g, chart, width) {
    const at = this.front.map((p) => this.#place(chart, p));
    g.strokeStyle = colour("ink");
    g.lineWidth = 1.6;
    g.beginPath();
    at.forEach(([x, y], k) => {
      if (k) g.lineTo(x, at[k - 1][1]);
      g[k ? "lineTo" : "moveTo"](x, y);
    });
    g.stroke();
    g.setLineDash([2, 4]);
    g.beginPath();
    g.moveTo(...at.at(-1));
    g.lineTo(width, at.at(-1)[1]);
    g.stroke();
    g.setLineDash([]);
  }

  #mark(g, chart, p) {
    const k = this.groups.indexOf(p.group);
    const [x, y] = this.#place(chart, p);
    const size = p.letter ? BOLD : SIZE;
    if (p.letter) {
      trace(g, k, x, y, size + 2.6);
      g.fillStyle = colour("ink");
      g.fill();
      trace(g, k, x, y, size + 1);
      g.fillStyle = colour("surface");
      g.fill();
    }
    trace(g, k, x, y, size);
    g.fillStyle = p.filled ? grouped(k) : colour("surface");
    g.strokeStyle = grouped(k);
    g.lineWidth = 1.5;
    g.globalAlpha = p.letter ? 1 : 0.85;
    g.fill();
    g.stroke();
    g.globalAlpha = 1;
  }

  /** Write the front's names where there is room, and their letters alone where there is none. */
  #name(g, chart, drawn, [width, height]) {
    const taken = drawn.map((p) => box(this.#place(chart, p), p.letter ? BOLD + 3 : SIZE));
    const corners = this.front.map((p) => this.#place(chart, p));
    corners.slice(1).forEach(([x, y], k) => {
      taken.push([x - 1, corners[k][1], x + 1, y]);
      taken.push([corners[k][0], corners[k][1] - 1, x, corners[k][1] + 1]);
    });
    this.front.forEach((p, k) => {
      const [x, y] = corners[k];
      const choices = [`${p.letter}  ${p.label}`, p.letter].flatMap((text) => {
        g.font = `600 ${FONT}`;
        const wide = g.measureText(text).width;
        return [
          [x - 12 - wide, y + 19],
          [x + 9, y + 22],
          [x - 14 - wide, y + 5],
          [x + 13, y - 10],
          [x - 12 - wide, y - 10],
        ].map(([left, base]) => ({
          text,
          left,
          base,
          area: [left - 2, base - 11, left + wide + 2, base + 3],
        }));
      });
      const inside = choices.filter(
        ({ area }) => area[0] >= 0 && area[1] >= 0 && area[2] <= width && area[3] <= height,
      );
      // A name beside another point of the front would be read as that one's.
      const clear = (area) =>
        corners.every((other, j) => j === k || away(area, other) > away(area, [x, y]) + 3);
      const free = inside.find(({ area }) => clear(area) && !taken.some((other) => overlap(area, other)));
      const put = free ?? inside.find(({ text, area }) => text === p.letter && clear(area)) ?? choices.at(-1);
      taken.push(put.area);
      g.textAlign = "left";
      g.lineWidth = 4;
      g.lineJoin = "round";
      g.strokeStyle = colour("surface");
      g.strokeText(put.text, put.left, put.base);
      g.fillStyle = colour("ink");
      g.fillText(put.text, put.left, put.base);
    });
  }

  /** Those that are drawn and not outside of a zoom, with their places in the plot. */
  #seen() {
    const { chart } = this;
    const [width, height] = [chart.over.clientWidth, chart.over.clientHeight];
    return this.points
      .filter((p) => this.#drawn(p))
      .map((p) => [p, ...this.#place(chart, p)])
      .filter(([, x, y]) => x >= 0 && y >= 0 && x <= width && y <= height);
  }

  #point(event) {
    if (!this.chart) return;
    const over = this.chart.over.getBoundingClientRect();
    const [x, y] = [event.clientX - over.left, event.clientY - over.top];
    const near = this.#seen()
      .map(([p, px, py]) => [p, Math.hypot(px - x, py - y)])
      .sort((a, b) => a[1] - b[1])[0];
    this.choose(near && near[1] <= REACH ? near[0] : null);
  }

  /** Arrow keys go from point to point: left and right by time, up and down by error. */
  onkey(event) {
    if (event.key === "Escape") return this.choose(null);
    const [by, step] =
      {
        ArrowLeft: ["x", -1],
        ArrowRight: ["x", 1],
        ArrowDown: ["y", -1],
        ArrowUp: ["y", 1],
        Home: ["x", -Infinity],
        End: ["x", Infinity],
      }[event.key] ?? [];
    if (!by) return null;
    event.preventDefault();
    const order = this.#seen()
      .map(([p]) => p)
      .sort((a, b) => a[by] - b[by]);
    const from = order.indexOf(this.#at ?? this.front[0]);
    const to = this.#at || Math.abs(step) > 1 ? from + step : from;
    return this.choose(order[Math.min(Math.max(to, 0), order.length - 1)] ?? null);
  }

  /** Point out a point, or none; where the plot does not show it, only the line below tells of it. */
  choose(p) {
    if (p === this.#at && p) return;
    this.#at = p;
    this.readout.textContent = p ? this.options.words(p) : (this.options.hint ?? "");
    const seen = p && this.chart ? this.#seen().find(([other]) => other === p) : null;
    this.tip.hidden = !seen;
    this.spot.hidden = !seen;
    if (!seen) return;
    const { over } = this.chart;
    const [x, y] = [over.offsetLeft + seen[1], over.offsetTop + seen[2]];
    move(this.spot, x, y);
    fill(this.tip, this.options.tip(p));
    // Away from the nearer edge, and never over the point.
    const [wide, tall] = [this.tip.offsetWidth, this.tip.offsetHeight];
    const left = x + 16 + wide <= this.box.clientWidth ? x + 16 : x - 16 - wide;
    const fits = left >= 0;
    move(
      this.tip,
      fits ? left : Math.max((this.box.clientWidth - wide) / 2, 0),
      fits
        ? Math.min(Math.max(y - tall / 2, 0), Math.max(this.box.clientHeight - tall, 0))
        : y > tall + 16
          ? y - tall - 14
          : y + 16,
    );
  }
}

/** Ends of an axis that leave room around all values. */
function reach(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const room = Math.max((high / low) ** ROOM, 1.12);
  return [low / room ** 1.6, high * room];
}

const box = ([x, y], size) => [x - size, y - size, x + size, y + size];
const away = (area, [x, y]) =>
  Math.hypot(Math.max(area[0] - x, x - area[2], 0), Math.max(area[1] - y, y - area[3], 0));
const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

function move(element, x, y) {
  element.style.left = `${x}px`;
  element.style.top = `${y}px`;
}
