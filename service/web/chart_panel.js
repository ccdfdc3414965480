/* One panel of a chart: choices of one kind as points, their front as a table, and what to do about it. */

import { card, h } from "./dom.js";
import { elapsed, figure, percent } from "./format.js";
import { keys, legend } from "./plots.js";
import { ScatterPlot } from "./scatter.js";

const LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
// Errors above twice the value itself say only that the fit went astray.
const ASTRAY = 2;
// A tolerance is drawn when it is at most so many times off.
const NEAR = 4;

/** The panel as a card; `tolerance` is what was asked for, where the panel's errors are of that kind. */
export function panelCard(view, panel, tolerance) {
  const write = panel.percent ? (e) => percent(e, 3) : (e) => figure(e, 2);
  const factor = panel.percent ? 100 : 1;
  const points = panel.points.map((p) => pointOf(p, panel, factor));
  const asked = tolerance ? askedFor(points, factor * tolerance, `${percent(tolerance, 3)} asked for`) : {};
  const of = (label) => points.find((p) => p.label === label);
  const plot = new ScatterPlot(points, {
    height: points.length > 30 ? 460 : 380,
    x_label: panel.seconds_label,
    y_label: panel.error_label,
    most: panel.percent ? factor * ASTRAY : undefined,
    limit: asked.limit,
    describe: `${panel.title}: ${points.length} choices, time against error, both logarithmic; ${panel.front.length} on the Pareto front. Arrow keys read points.`,
    hint: "Point at the plot or use the arrow keys to read points; drag to zoom, double-click to return.",
    words: (p) => `${p.label}: ${elapsed(p.source.seconds.median)}, error ${write(p.source.error.median)}`,
    tip: (p) => tip(p, panel, write),
  });
  view.atEnd(() => plot.destroy());
  return card(
    panel.title,
    { id: `panel-${panel.name}` },
    h("p", { class: "finding" }, panel.finding),
    h(
      "div",
      { class: "panel" },
      h(
        "div",
        { class: "stack close" },
        plot.element,
        legend("Kinds of choices shown", plot.keys, [plot]),
        signs(panel, asked.note),
      ),
      h(
        "div",
        { class: "stack close" },
        h("h3", {}, "The Pareto front"),
        h("p", { class: "note" }, "Nothing that was measured is both faster and better than these."),
        frontTable(panel.front.map(of), plot, write, tolerance),
        panel.level.length
          ? h("p", { class: "note" }, `Level with it, as far as these runs tell: ${panel.level.join("; ")}.`)
          : null,
      ),
    ),
    h("details", {}, h("summary", {}, `All ${points.length} choices`), allTable(panel, points, write)),
    failures(panel),
    h("details", {}, h("summary", {}, "How it was measured"), list(panel.notes)),
  );
}

/** A line at what was asked for, or a note where it is so far off that the points would have no room. */
function askedFor(points, y, words) {
  const errors = points.map((p) => p.y);
  if (y < Math.min(...errors) / NEAR) return { note: `${words}: far below this plot` };
  if (y > Math.max(...errors) * NEAR) return { note: `${words}: far above this plot` };
  return { limit: { y, words } };
}

function pointOf(p, panel, factor) {
  const { seconds, error } = p;
  const place = panel.front.indexOf(p.label);
  return {
    label: p.label,
    group: p.group,
    letter: place < 0 ? null : (LETTERS[place] ?? String(place + 1)),
    filled: p.usual,
    x: seconds.median,
    x_low: seconds.low,
    x_high: seconds.high,
    y: factor * error.median,
    y_low: factor * error.low,
    y_high: factor * error.high,
    source: p,
  };
}

/** A median with its quartiles, where there are several runs. */
function spread({ median, low, high, runs }, write) {
  return runs.length > 1 && low < high ? `${write(median)} (${write(low)} to ${write(high)})` : write(median);
}

const standing = (p, panel) =>
  [
    p.source.group,
    p.source.usual ? "usual" : null,
    p.letter ? `${p.letter} of the front` : null,
    panel.level.includes(p.label) ? "level with the front" : null,
  ]
    .filter(Boolean)
    .join(" · ");

function tip(p, panel, write) {
  const rows = [
    ["time", spread(p.source.seconds, elapsed)],
    ["error", spread(p.source.error, write)],
    ...settings(p.source.settings),
  ];
  return [
    h("strong", {}, p.label),
    h("small", {}, standing(p, panel)),
    h(
      "dl",
      {},
      rows.map(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]),
    ),
  ];
}

/** Settings as names and words; those of a group stand in one line. */
function settings(found) {
  const say = (value) => (typeof value === "number" ? figure(value, 6) : String(value));
  return Object.entries(found)
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([name, value]) => [
      plain(name),
      typeof value === "object"
        ? Object.entries(value)
            .map(([key, v]) => `${plain(key)} ${say(v)}`)
            .join(", ")
        : say(value),
    ])
    .filter(([, words]) => words);
}

const plain = (name) => name.replaceAll("_", " ");

function signs(panel, note) {
  const dot = (filled) => {
    const found = h("span", { class: filled ? "dot" : "dot hollow", "aria-hidden": "true" });
    found.style[filled ? "background" : "borderColor"] = "currentColor";
    return found;
  };
  const astray = panel.percent ? panel.points.filter((p) => p.error.median > ASTRAY).length : 0;
  const usual = panel.points.some((p) => p.usual);
  return keys([
    ["Pareto front", "none"],
    ...(usual ? [["the usual choice", dot(true)]] : []),
    ["another one", dot(false)],
    ...(panel.points.some((p) => p.seconds.runs.length > 1) ? [["bars: half of the runs", null]] : []),
    ...(note ? [[note, null]] : []),
    ...(astray ? [[`${astray} beyond ${percent(ASTRAY, 3)} at the upper edge`, null]] : []),
  ]);
}

function frontTable(front, plot, write, tolerance) {
  // The first within the tolerance is the fastest.
  const chosen = tolerance ? front.find((p) => p.source.error.median <= tolerance) : null;
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": "The Pareto front" },
    h(
      "table",
      { class: "front" },
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          ["", "Choice", "Time", "Error"].map((title, k) =>
            h("th", { scope: "col", class: k > 1 ? "number" : null }, title),
          ),
        ),
      ),
      h(
        "tbody",
        {},
        front.map((p) =>
          h(
            "tr",
            {
              class: p === chosen ? "best" : null,
              onpointerenter: () => plot.choose(p),
              onpointerleave: () => plot.choose(null),
            },
            h(
              "td",
              {},
              h(
                "button",
                {
                  type: "button",
                  class: "quiet",
                  "aria-label": `Show ${p.label} in the plot`,
                  onfocus: () => plot.choose(p),
                  onblur: () => plot.choose(null),
                  onclick: () => plot.choose(p),
                },
                p.letter,
              ),
            ),
            h(
              "th",
              { scope: "row" },
              p.label,
              p === chosen ? [" ", h("span", { class: "chip good" }, "what you asked for")] : null,
            ),
            h("td", { class: "number" }, elapsed(p.source.seconds.median)),
            h("td", { class: "number" }, write(p.source.error.median)),
          ),
        ),
      ),
    ),
  );
}

function allTable(panel, points, write) {
  const order = [...points].sort((a, b) => a.y - b.y || a.x - b.x);
  return h(
    "div",
    { class: "scroll tall", tabindex: "0", role: "region", "aria-label": `All choices: ${panel.title}` },
    h(
      "table",
      {},
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          ["Choice", "Kind", "Time", "Error"].map((title, k) =>
            h("th", { scope: "col", class: ["", "narrow-off", "number", "number"][k] }, title),
          ),
        ),
      ),
      h(
        "tbody",
        {},
        order.map((p) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, p.label),
            h("td", { class: "narrow-off" }, h("small", {}, standing(p, panel))),
            h("td", { class: "number" }, spread(p.source.seconds, elapsed)),
            h("td", { class: "number" }, spread(p.source.error, write)),
          ),
        ),
      ),
    ),
  );
}

function failures(panel) {
  const found = Object.entries(panel.failed);
  if (!found.length) return null;
  return h(
    "details",
    {},
    h("summary", {}, `${found.length} could not be measured`),
    list(found.map(([label, reason]) => [h("strong", {}, label), `: ${reason}`])),
  );
}

const list = (texts) =>
  h(
    "ul",
    {},
    texts.map((text) => h("li", {}, text)),
  );
