/* The first view: bring a measurement, or try a sample, or go on with an old fit. */

import { list } from "./api.js";
import { card, fill, h, select } from "./dom.js";
import { Intake } from "./intake.js";
import { SETS } from "./options.js";
import { fitItems } from "./past.js";
import { problemCard } from "./problem.js";
import { SAMPLES } from "./samples.js";

const EXAMPLE = `theta_i,phi_i,theta_o,phi_o,R,G,B
30,0,10,180,0.412,0.297,0.215
30,0,30,180,1.734,1.102,0.846`;

export async function startView(view) {
  const answer = h("div", { "aria-live": "polite" });
  const past = h("div", {}, h("p", { class: "note" }, "…"));
  let models = "standard";
  const intake = new Intake(view, answer, () => models);
  view.show(
    "New fit",
    h(
      "div",
      {},
      h("h1", {}, "Fit a reflectance model to your measurement"),
      h(
        "p",
        { class: "lead" },
        "Drop a goniometer’s table of directions and BRDF values. Every candidate model is fitted to it, and the simplest one that describes it is named, with what is known of its parameters.",
      ),
    ),
    answer,
    h(
      "div",
      { class: "columns" },
      h(
        "div",
        { class: "stack" },
        dropZone(intake, models, (set) => (models = set)),
        card(
          "Or try a sample",
          {
            id: "samples",
            note: "The service simulates a goniometer, noise included, and reads its file back as if it were yours.",
          },
          samples(intake),
        ),
      ),
      h(
        "div",
        { class: "stack" },
        card("Past fits", { id: "recent", tools: [h("a", { href: "#/past" }, "All")] }, past),
        card(
          "The file",
          { id: "format" },
          h("pre", { class: "format", tabindex: "0", "aria-label": "Example of a file" }, EXAMPLE),
          h(
            "p",
            { class: "note" },
            "Angles in degrees, away from the surface; the mirror direction is phi_o = phi_i + 180. Values are BRDF in 1/sr, one column a channel, and sigma_ columns may state their uncertainty.",
          ),
        ),
      ),
    ),
  );
  try {
    fill(past, fitItems((await list("fits")).items.slice(0, 6), false));
  } catch (error) {
    fill(past, problemCard(error));
  }
}

function dropZone(intake, models, choose) {
  const input = h("input", {
    type: "file",
    id: "file",
    class: "visually-hidden",
    tabindex: "-1",
    multiple: true,
    accept: ".csv,.txt,.gz,.binary,text/csv,application/gzip",
    onchange: () => {
      intake.take(input.files);
      input.value = "";
    },
  });
  const over = (on) => (event) => {
    event.preventDefault();
    zone.classList.toggle("over", on);
  };
  const zone = h(
    "section",
    {
      class: "drop",
      "aria-label": "Upload a measurement",
      ondragover: over(true),
      ondragleave: over(false),
      ondrop: (event) => {
        over(false)(event);
        intake.take(event.dataTransfer.files);
      },
    },
    h("img", { src: "static/logo.svg", alt: "" }),
    h("strong", {}, "Drop a CSV here, or many"),
    h("button", { type: "button", class: "primary", onclick: () => input.click() }, "Choose files"),
    h("small", {}, "CSV, CSV.gz or MERL .binary. They go to this service and nowhere else."),
    h(
      "label",
      { class: "several" },
      "Several at once are all fitted, with the models ",
      select(
        SETS.filter(([set]) => set !== "chosen").map(([set, title]) => [set, title.toLowerCase()]),
        models,
        choose,
      ),
    ),
    h("label", { for: "file", class: "visually-hidden" }, "Measurement files"),
    input,
  );
  return zone;
}

function samples(intake) {
  return h(
    "div",
    { class: "samples" },
    SAMPLES.map((sample) => {
      const swatch = h("span", { class: "swatch", "aria-hidden": "true" });
      swatch.style.background = `linear-gradient(90deg, ${sample.colours.join(", ")})`;
      return h(
        "button",
        { type: "button", onclick: () => intake.sample(sample) },
        swatch,
        h("strong", {}, sample.title),
        h("small", {}, sample.words),
      );
    }),
  );
}
