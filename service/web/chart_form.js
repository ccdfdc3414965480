/* The form that starts a chart of speed against accuracy. */

import { submit } from "./api.js";
import { field, fill, h, select } from "./dom.js";
import { SETS } from "./options.js";
import { problemCard } from "./problem.js";

const GROUPS = [
  ["evaluation", "how to evaluate a model"],
  ["albedo", "how to integrate the albedo"],
  ["posterior", "how to sample the posterior"],
];

/** A button, and the panel of this class with the form that it opens; `measurement` has an id and a name. */
export function chartOffer(measurement, kind = null) {
  const panel = h("div", { hidden: true, id: "chart-form", class: kind });
  const button = h(
    "button",
    { type: "button", "aria-expanded": "false", "aria-controls": "chart-form", onclick: toggle },
    "Chart speed against accuracy",
  );
  function toggle() {
    panel.hidden = !panel.hidden;
    button.setAttribute("aria-expanded", !panel.hidden);
    if (!panel.firstChild) panel.append(chartForm(measurement));
    if (!panel.hidden) panel.querySelector("select").focus();
  }
  return { button, panel };
}

function chartForm(measurement) {
  const answer = h("div");
  const number = (name, attributes) => h("input", { type: "number", name, required: true, ...attributes });
  const names = field(
    "Names",
    h("input", { type: "text", name: "names", placeholder: "lambert, ggx:k_s=1, ggx+ggx" }),
    "separated by commas",
  );
  names.hidden = true;
  const button = h("button", { type: "submit", class: "primary" }, "Make the chart");
  const form = h(
    "form",
    { class: "stack", onsubmit: send },
    h(
      "div",
      { class: "fields" },
      field(
        "Models",
        select(
          SETS.map(([value, title]) => [value, title]),
          "standard",
          (set) => (names.hidden = set !== "chosen"),
          { name: "set" },
        ),
        "tried with the usual settings; the best few in other ways too",
      ),
      names,
      field(
        "Error that would do [%]",
        number("tolerance", { value: "2", min: "0.01", max: "1000", step: "any" }),
        "relative, of the prediction",
      ),
      field("Timed runs of each", number("repeats", { value: "3", min: "1", max: "50", step: "1" })),
    ),
    h(
      "fieldset",
      {},
      h("legend", {}, "Besides how to fit, compare"),
      GROUPS.map(([value, words]) =>
        h(
          "label",
          { class: "choice" },
          h("input", { type: "checkbox", name: "group", value, checked: true }),
          h("span", {}, words),
        ),
      ),
    ),
    h("p", { class: "note" }, "Minutes, with many models: each is fitted again and again."),
    h("div", {}, button),
    answer,
  );

  async function send(event) {
    event.preventDefault();
    button.disabled = true;
    try {
      const chart = await submit("charts", request(new FormData(form), measurement));
      window.location.hash = `#/charts/${chart.id}`;
    } catch (error) {
      fill(answer, problemCard(error));
    } finally {
      button.disabled = false;
    }
  }

  return form;
}

/** The request that a filled form stands for. */
function request(data, measurement) {
  const names = data
    .get("names")
    .split(",")
    .map((name) => name.trim())
    .filter(Boolean);
  return {
    measurement: measurement.id,
    models: data.get("set") === "chosen" ? names : data.get("set"),
    tolerance: Number(data.get("tolerance")) / 100,
    repeats: Number(data.get("repeats")),
    groups: ["fit", ...data.getAll("group")],
    name: measurement.name || null,
  };
}
