/* A chart of speed against accuracy: its progress while it is measured, then its panels. */

import * as api from "./api.js";
import { panelCard } from "./chart_panel.js";
import { h } from "./dom.js";
import { downloads } from "./downloads.js";
import { count, duration } from "./format.js";
import { hasEnded, heading, settle, trouble, watch } from "./job.js";
import { problemCard } from "./problem.js";

export async function chartView(view, id) {
  view.show("Chart", h("p", { class: "note" }, "Loading …"));
  const load = () => api.get("charts", id);
  const chart = await load();
  if (hasEnded(chart)) return ended(view, chart);
  const progress = watch(view, "charts", chart, {
    onend: () => settle(view, "chart", load, (now) => ended(view, now)),
    failed: (error) => view.show(title(chart), head(chart), problemCard(error)),
  });
  view.show(
    title(chart),
    head(chart),
    progress,
    h(
      "p",
      { class: "note" },
      "Choices are timed in turn while nothing else runs in this process; other work on this computer makes the bars longer.",
    ),
  );
}

function ended(view, chart) {
  const { result } = chart;
  view.show(
    title(chart),
    head(chart),
    trouble(chart, "chart"),
    result
      ? [
          h(
            "section",
            { class: `card verdict${reached(result) ? "" : " doubt"}`, "aria-labelledby": "answer" },
            h("h2", { id: "answer", class: "eyebrow" }, "The answer"),
            h("p", { class: "said" }, result.answer),
          ),
          result.panels.map((panel, k) => panelCard(view, panel, k ? null : result.tolerance)),
          about(result),
        ]
      : null,
    chart.artefacts.length ? downloads("charts", chart) : null,
  );
}

/** Whether a fit keeps within what was asked for. */
const reached = ({ panels, tolerance }) => panels[0].points.some((p) => p.error.median <= tolerance);

const title = (chart) => chart.name || `Chart ${chart.id.slice(0, 8)}`;

const head = (chart) =>
  heading("charts", chart, title(chart), "the measurement", ["chart.png", "Picture (PNG)"]);

function about(result) {
  const { settings, versions } = result;
  const models = Array.isArray(settings.models) ? settings.models.join(", ") : settings.models;
  return h(
    "p",
    { class: "note" },
    `Models ${models}; metric ${settings.metric}; ${count(settings.repeats, "timed run")} of each; seed ${settings.seed}; `,
    `${duration(result.seconds)} on ${result.device}; `,
    Object.entries(versions)
      .map(([name, v]) => `${name} ${v}`)
      .join(", "),
    `; schema ${result.schema}.`,
  );
}
