/* The first view: bring a measurement, or try a sample, or go on with an old fit. */

import { fits, simulate, upload } from "./api.js";
import { card, fill, h } from "./dom.js";
import { bytes } from "./format.js";
import { fitItems } from "./past.js";
import { problemCard } from "./problem.js";
import { SAMPLES } from "./samples.js";

const EXAMPLE = `theta_i,phi_i,theta_o,phi_o,R,G,B
30,0,10,180,0.412,0.297,0.215
30,0,30,180,1.734,1.102,0.846`;

export async function startView(view) {
  const answer = h("div", { "aria-live": "polite" });
  const past = h("div", {}, h("p", { class: "note" }, "…"));
  const intake = new Intake(view, answer);
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
        dropZone(intake),
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
    fill(past, fitItems((await fits()).items.slice(0, 6), false));
  } catch (error) {
    fill(past, problemCard(error));
  }
}

/** Takes files from wherever they come and shows what became of them. */
class Intake {
  #busy = false;

  constructor(view, answer) {
    this.view = view;
    this.answer = answer;
  }

  take(file) {
    return this.#work(
      `Reading and checking ${file.name} (${bytes(file.size)}) …`,
      () => upload(file, file.name),
      file,
    );
  }

  sample(sample) {
    return this.#work(`Simulating ${sample.title} …`, async () =>
      upload(await simulate(sample.body), sample.name),
    );
  }

  async #work(words, work, file = null) {
    if (this.#busy) return;
    this.#busy = true;
    fill(
      this.answer,
      h("div", { class: "notice" }, h("p", {}, words), h("div", { class: "progress waiting" }, h("div"))),
    );
    this.answer.scrollIntoView({ block: "nearest" });
    try {
      const found = await work();
      if (!this.view.over) window.location.hash = `#/measurements/${found.id}`;
    } catch (error) {
      fill(this.answer, problemCard(error, file));
      this.answer.scrollIntoView({ block: "nearest" });
    } finally {
      this.#busy = false;
    }
  }
}

function dropZone(intake) {
  const input = h("input", {
    type: "file",
    id: "file",
    class: "visually-hidden",
    tabindex: "-1",
    accept: ".csv,.txt,.gz,.binary,text/csv,application/gzip",
    onchange: () => {
      if (input.files.length) intake.take(input.files[0]);
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
        if (event.dataTransfer.files.length) intake.take(event.dataTransfer.files[0]);
      },
    },
    h("img", { src: "static/logo.svg", alt: "" }),
    h("strong", {}, "Drop a CSV here"),
    h("button", { type: "button", class: "primary", onclick: () => input.click() }, "Choose a file"),
    h("small", {}, "CSV, CSV.gz or MERL .binary. It goes to this service and nowhere else."),
    h("label", { for: "file", class: "visually-hidden" }, "Measurement file"),
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
