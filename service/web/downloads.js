/* Files of a fit. They are fetched, since a link cannot carry a token. */

import { archive, artefact } from "./api.js";
import { card, h } from "./dom.js";
import { bytes } from "./format.js";
import { problemCard } from "./problem.js";

const WORDS = {
  "report.json": "everything about the fit, with a schema",
  "posterior.json": "summary of the posterior",
  "posterior.nc": "the posterior, for ArviZ",
  "fit.png": "measured and fitted",
  "lobes.exr": "measured, fitted and residual as a picture",
  "samples.csv": "measured and fitted values, row by row",
  "corner.png": "parameters against each other",
  "trace.png": "the chains",
  "predictive.png": "what the posterior predicts",
};

/** Save one artefact, or the zip of all. */
export async function download(fit, name) {
  if (name) save(await artefact(fit.id, name), name);
  else save(await archive(fit.id), `lobefit-${fit.id.slice(0, 8)}.zip`);
}

/** Hand bytes to the browser as a file of this name. */
export function save(blob, name) {
  const url = URL.createObjectURL(blob);
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

export function downloads(fit) {
  const problems = h("div");
  const get = (name) => () =>
    download(fit, name).catch((error) => problems.replaceChildren(problemCard(error)));
  return card(
    "Downloads",
    { id: "downloads", tools: [h("button", { type: "button", onclick: get(null) }, "All as a zip")] },
    h(
      "ul",
      { class: "items plain files" },
      fit.artefacts.map((a) =>
        h(
          "li",
          {},
          h(
            "div",
            {},
            h("button", { type: "button", class: "link", onclick: get(a.name) }, a.name),
            h("small", {}, WORDS[a.name] ?? a.media_type),
          ),
          h("small", {}, bytes(a.bytes)),
        ),
      ),
    ),
    problems,
  );
}
