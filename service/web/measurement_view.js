/* What was understood of an upload, before anything is fitted. */

import { file, get, models, table } from "./api.js";
import { chartOffer } from "./chart_form.js";
import { checkList } from "./checks.js";
import { card, fill, h } from "./dom.js";
import { save } from "./downloads.js";
import { bytes, count, degrees, figure } from "./format.js";
import { measuredPlot } from "./measured_plot.js";
import { fitForm } from "./options.js";
import { problemCard } from "./problem.js";

export async function measurementView(view, id) {
  view.show("Measurement", h("p", { class: "note" }, "Loading …"));
  const found = await get("measurements", id);
  const { summary } = found;
  const plot = h("div", { class: "stack" }, h("p", { class: "note" }, "Drawing …"));
  const form = h("div", {}, h("p", { class: "note" }, "Loading the models …"));
  view.show(
    found.name || "Measurement",
    h("div", {}, h("h1", {}, found.name || id.slice(0, 12)), h("p", { class: "lead" }, understood(summary))),
    h(
      "div",
      { class: "columns" },
      h(
        "div",
        { class: "stack" },
        plot,
        card(
          "What was understood",
          { id: "understood" },
          figures(found),
          channels(summary),
          losses(summary),
          metadata(summary),
        ),
        card("Can the numbers be what they say they are?", { id: "checks" }, checkList(found.checks)),
      ),
      h("div", { class: "stack" }, form, chartCard(found)),
    ),
  );
  await Promise.all([
    drawCurves(view, plot, id, summary),
    models().then(
      (known) => fill(form, fitForm(found, known)),
      (error) => fill(form, problemCard(error)),
    ),
  ]);
}

function chartCard(found) {
  const offer = chartOffer(found);
  return card(
    "What does accuracy cost?",
    { id: "chart", note: "Fits in many ways to one part, scored on the rest, with the time that each took." },
    offer.button,
    offer.panel,
  );
}

/** Draw the measured curves as a card into a box, if they are `wanted` still when they are there. */
export async function drawCurves(view, box, id, summary, wanted = () => true) {
  try {
    const rows = await table(id);
    if (!wanted()) return;
    const { tools, content } = measuredPlot(view, rows, summary.decades);
    fill(box, card("Measured curves", { id: "curves", tools }, content));
  } catch (error) {
    fill(box, problemCard(error));
  }
}

/** The measurement in one sentence. */
export function understood(summary) {
  const names = summary.channels.map((c) => c.name);
  const shown = names.length > 6 ? `${names[0]} to ${names.at(-1)}` : names.join(", ");
  const material = summary.metadata.material;
  return [
    material ? `${material}: ` : "",
    `${count(summary.rows.used, "direction")} at ${count(summary.incidences, "incidence")}, `,
    `${count(names.length, "channel")} (${shown}).`,
  ].join("");
}

function figures(found) {
  const { summary } = found;
  const range = ([low, high]) => (low === high ? degrees(low) : `${figure(low, 4)}–${degrees(high)}`);
  const entries = [
    [
      "Rows used",
      summary.rows.used.toLocaleString("en"),
      summary.rows.dropped ? `of ${summary.rows.read}` : "all that were read",
    ],
    ["Incidences", summary.incidences.toLocaleString("en"), `theta_i ${range(summary.theta_i_deg)}`],
    ["Views", range(summary.theta_o_deg), summary.azimuthal_evidence ? "the sample was turned" : "theta_o"],
    ["Range of values", `${figure(summary.decades, 2)} decades`, summary.unit],
    [
      "Uncertainty",
      summary.sigma_given ? "given" : "estimated",
      summary.sigma_given ? "sigma_ columns" : "from the residuals",
    ],
    [
      "File",
      bytes(found.bytes),
      h(
        "button",
        {
          type: "button",
          class: "link",
          onclick: async (event) => {
            try {
              save(await file("measurements", found.id, "data"), found.name || "measurement.csv");
            } catch (error) {
              event.target.after(problemCard(error));
            }
          },
        },
        "download",
      ),
    ],
  ];
  return h(
    "dl",
    { class: "figures" },
    entries.map(([name, value, words]) =>
      h("div", {}, h("dt", {}, name), h("dd", {}, value, h("small", {}, words))),
    ),
  );
}

function channels(summary) {
  const rows = summary.channels.map((c) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, c.name),
      h("td", { class: "number" }, c.values.toLocaleString("en")),
      h("td", { class: "number" }, figure(c.lowest)),
      h("td", { class: "number" }, figure(c.highest)),
      h("td", { class: "number" }, c.negative ? String(c.negative) : "none"),
    ),
  );
  const table = h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": "Channels" },
    h(
      "table",
      {},
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          ["Channel", "Values", "Lowest", "Highest", "Negative"].map((t, k) =>
            h("th", { scope: "col", class: k ? "number" : null }, t),
          ),
        ),
      ),
      h("tbody", {}, rows),
    ),
  );
  return rows.length > 6 ? h("details", {}, h("summary", {}, `All ${rows.length} channels`), table) : table;
}

/** Rows left out and notes of the reader. */
function losses(summary) {
  const said = summary.dropped.map((d) => {
    const lines = d.first_lines.slice(0, 8).join(", ") + (d.count > 8 ? ", …" : "");
    return `${count(d.count, "row")} dropped: ${d.rule}${lines ? ` (lines ${lines})` : ""}`;
  });
  if (summary.rows.merged)
    said.push(`${count(summary.rows.merged, "row")} merged into others of the same direction`);
  said.push(...summary.notes);
  return said.length
    ? h(
        "div",
        { class: "notice warm" },
        h(
          "ul",
          { class: "plain" },
          said.map((text) => h("li", {}, text)),
        ),
      )
    : null;
}

function metadata(summary) {
  const entries = Object.entries(summary.metadata);
  if (!entries.length) return null;
  return h(
    "details",
    {},
    h("summary", {}, "The file’s header"),
    h(
      "dl",
      { class: "figures" },
      entries.map(([key, value]) => h("div", {}, h("dt", {}, key), h("dd", {}, h("small", {}, value)))),
    ),
  );
}
