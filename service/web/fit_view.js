/* A fit: its progress while it runs, then what came of it. */

import * as api from "./api.js";
import { chartOffer } from "./chart_form.js";
import { Comparison } from "./comparison.js";
import { fill, h } from "./dom.js";
import { downloads } from "./downloads.js";
import { hasEnded, heading, settle, trouble, watch } from "./job.js";
import { drawCurves } from "./measurement_view.js";
import { problemCard } from "./problem.js";
import { resultParts } from "./result.js";

export async function fitView(view, id) {
  view.show("Fit", h("p", { class: "note" }, "Loading …"));
  const fit = await api.get("fits", id);
  if (hasEnded(fit)) return ended(view, fit);
  running(view, fit);
}

function running(view, fit) {
  const below = h("div", { class: "stack" });
  const early = earlyResult(view, fit, below);
  const load = () => api.get("fits", fit.id);
  const progress = watch(view, "fits", fit, {
    onprogress: (p) => early.look(p.stage),
    onend: () => settle(view, "fit", load, (now) => ended(view, now, early.compared)),
    failed: (error) => view.show(title(fit), head(fit), problemCard(error)),
  });
  view.show(title(fit), head(fit), progress, below);
}

/** Below the progress: the measured curves, and the report as soon as it is there. */
function earlyResult(view, fit, box) {
  let stage = "";
  let shown = false;
  let compared = null;
  api.get("measurements", fit.measurement).then(
    (m) => !shown && drawCurves(view, box, m.id, m.summary, () => !shown),
    () => {}, // the progress is what matters here
  );
  const look = async (now) => {
    // The report is written before the posterior is sampled and the pictures are made.
    if (shown || now === stage || now === "fit") return;
    stage = now;
    const found = await api.get("fits", fit.id).catch(() => null);
    if (shown || view.over || !found?.result || hasEnded(found)) return;
    shown = true;
    compared = new Comparison(found);
    fill(box, resultParts(view, found, compared));
  };
  return {
    look,
    get compared() {
      return compared;
    },
  };
}

function ended(view, fit, before = null) {
  const offer = chartOffer({ id: fit.measurement, name: fit.name }, "card");
  view.show(
    title(fit),
    head(fit, offer.button),
    offer.panel,
    trouble(fit, "fit"),
    fit.result?.results?.length ? resultParts(view, fit, new Comparison(fit, before)) : null,
    fit.artefacts.length ? downloads("fits", fit) : null,
  );
}

const title = (fit) => fit.name || `Fit ${fit.id.slice(0, 8)}`;
const REPORT = ["report.json", "Report (JSON)"];

const head = (fit, ...tools) =>
  heading("fits", fit, title(fit), "the measurement, fit again", REPORT, [
    fit.batch ? h("a", { href: `#/batches/${fit.batch}` }, "Its batch") : null,
    tools,
  ]);
