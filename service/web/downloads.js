/* Files of a fit, a chart or a batch. They are fetched, since a link cannot carry a token. */

import { artefact, file } from "./api.js";
import { card, h } from "./dom.js";
import { bytes } from "./format.js";
import { problemCard } from "./problem.js";

const WORDS = {
  "report.json": "everything about the fit, with a schema",
  "posterior.json": "summary of the posterior",
  "posterior.nc": "the posterior, for ArviZ",
  "fit.png": "measured and fitted",
  "lobes.exr": "measured, fitted and residual as a picture",
  "albedo.exr": "share of light that leaves the surface, by direction of incidence",
  "samples.csv": "measured and fitted values, row by row",
  "corner.png": "parameters against each other",
  "trace.png": "the chains",
  "predictive.png": "what the posterior predicts",
  "chart.json": "every choice with its settings and runs, with a schema",
  "chart.png": "the chart as a picture",
  "table.csv": "a row per file: state, best model, how well it describes, verdict",
  "parameters.csv": "a row per parameter of each best model",
  "summary.png": "the batch as a picture",
};

/** Save one artefact, or the zip of all. */
export async function download(kind, id, name) {
  if (name) save(await artefact(kind, id, name), name);
  else save(await file(kind, id, "artefacts.zip"), `lobefit-${id.slice(0, 8)}.zip`);
}

/** Hand bytes to the browser as a file of this name. */
export function save(blob, name) {
  const url = URL.createObjectURL(blob);
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/** The artefacts of a fit or chart. */
export function downloads(kind, job) {
  return fileCard(job.artefacts, (name) => download(kind, job.id, name), true);
}

/** A card of files {name, bytes, media_type}; `get(name)` saves one, and without a name the zip of all. */
export function fileCard(files, get, zip = false) {
  const problems = h("div");
  const onclick = (name) => () =>
    get(name).then(
      () => problems.replaceChildren(),
      (error) => problems.replaceChildren(problemCard(error)),
    );
  return card(
    "Downloads",
    {
      id: "downloads",
      tools: zip ? [h("button", { type: "button", onclick: onclick(null) }, "All as a zip")] : [],
    },
    h(
      "ul",
      { class: "items plain files" },
      files.map((f) =>
        h(
          "li",
          {},
          h(
            "div",
            {},
            h("button", { type: "button", class: "link", onclick: onclick(f.name) }, f.name),
            h("small", {}, WORDS[f.name] ?? f.media_type),
          ),
          f.bytes ? h("small", {}, bytes(f.bytes)) : null,
        ),
      ),
    ),
    problems,
  );
}
