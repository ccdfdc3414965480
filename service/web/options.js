/* The form that starts a fit. */

import { submit } from "./api.js";
import { card, field, fill, h, select } from "./dom.js";
import { problemCard } from "./problem.js";

/** Sets of candidates, with words about them. */
export const SETS = [
  ["quick", "Quick", "a few models that people use most"],
  ["standard", "Standard", "the models in common use and their variants"],
  ["all", "All", "every model there is, special lobes included"],
  ["chosen", "Choose", "by name"],
];
const METRICS = [
  ["auto", "automatic"],
  ["chi2", "the stated uncertainty (chi2)"],
  ["relative", "relative"],
  ["log", "logarithms"],
  ["cube_root", "cube roots"],
  ["cosine_log", "logarithms with the cosine"],
];

export function fitForm(measurement, known) {
  const form = h("form", { class: "stack", onsubmit: send, "aria-describedby": "fit-problem" });
  const answer = h("div", { id: "fit-problem" });
  const chosen = h("div", { hidden: true, class: "stack" }, modelBoxes(known));
  const sets = h(
    "fieldset",
    {},
    h("legend", {}, "Candidate models"),
    SETS.map(([value, title, words]) =>
      h(
        "label",
        { class: "choice" },
        h("input", {
          type: "radio",
          name: "set",
          value,
          checked: value === "standard",
          onchange: () => (chosen.hidden = value !== "chosen"),
        }),
        h("span", {}, title),
        h("small", {}, words),
      ),
    ),
  );
  const number = (name, attributes) => h("input", { type: "number", name, ...attributes });
  const steps = h(
    "div",
    { hidden: true, class: "stack" },
    field(
      "Steps of the sampler",
      number("steps", { value: "10000", min: "100", max: "1000000", step: "100" }),
      "at most; it stops when it has converged",
    ),
  );
  const posterior = h(
    "label",
    { class: "choice" },
    h("input", {
      type: "checkbox",
      name: "posterior",
      onchange: (event) => (steps.hidden = !event.target.checked),
    }),
    h("span", {}, "Sample the posterior"),
    h("small", {}, "honest intervals for the best model; takes longer"),
  );
  const button = h("button", { type: "submit", class: "primary" }, "Fit");
  form.append(
    sets,
    chosen,
    posterior,
    steps,
    h(
      "details",
      {},
      h("summary", {}, "More options"),
      h(
        "div",
        { class: "stack" },
        field(
          "Weigh residuals by",
          select(METRICS, "auto", () => {}, { name: "metric" }),
        ),
        field(
          "Tolerance [%]",
          number("tolerance", { min: "0.01", max: "100", step: "any", placeholder: "none" }),
          "a relative error of radiance that does not matter: simpler models then suffice",
        ),
        field(
          "Leave out angles above [°]",
          number("max_theta", { min: "1", max: "90", step: "any", placeholder: "none" }),
        ),
        field("Seed", number("seed", { value: "0", min: "0", step: "1" })),
        field(
          "Name",
          h("input", { type: "text", name: "name", maxlength: "200", placeholder: measurement.name || "" }),
        ),
      ),
    ),
    button,
    answer,
  );

  async function send(event) {
    event.preventDefault();
    button.disabled = true;
    try {
      const fit = await submit("fits", body(new FormData(form), measurement));
      window.location.hash = `#/fits/${fit.id}`;
    } catch (error) {
      fill(answer, problemCard(error));
    } finally {
      button.disabled = false;
    }
  }

  return card("Fit it", { id: "fit" }, form);
}

function modelBoxes(known) {
  return [
    h(
      "details",
      { open: true },
      h("summary", {}, `${known.length} models`),
      h(
        "fieldset",
        { class: "models" },
        h("legend", { class: "visually-hidden" }, "Models"),
        known.map((m) =>
          h(
            "label",
            { class: "choice" },
            h("input", { type: "checkbox", name: "model", value: m.name }),
            h("span", {}, m.name),
            h("small", {}, m.title),
          ),
        ),
      ),
    ),
    field(
      "Variants and sums",
      h("input", { type: "text", name: "extra", placeholder: "ggx:k_s=1, ggx+ggx" }),
      "separated by commas",
    ),
  ];
}

/** The request that a filled form stands for. */
function body(data, measurement) {
  const set = data.get("set");
  const extra = (data.get("extra") ?? "")
    .split(",")
    .map((name) => name.trim())
    .filter(Boolean);
  const given = (name) => (data.get(name) ? Number(data.get(name)) : null);
  const tolerance = given("tolerance");
  return {
    measurement: measurement.id,
    models: set === "chosen" ? [...data.getAll("model"), ...extra] : set,
    metric: data.get("metric"),
    tolerance: tolerance === null ? null : tolerance / 100,
    max_theta_deg: given("max_theta"),
    posterior: data.get("posterior") ? { steps: given("steps") } : null,
    seed: given("seed") ?? 0,
    name: data.get("name").trim() || measurement.name || null,
  };
}
