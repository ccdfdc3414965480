/* A fit: its progress while it runs, then what came of it. */

import * as api from "./api.js";
import { Comparison } from "./comparison.js";
import { fill, h } from "./dom.js";
import { download, downloads } from "./downloads.js";
import { follow } from "./events.js";
import { when } from "./format.js";
import { problemCard } from "./problem.js";
import { drawCurves } from "./measurement_view.js";
import { ProgressCard } from "./progress.js";
import { resultParts } from "./result.js";

const LOOKS = 8;
const LATER = 2000;
const ENDED = ["done", "failed", "cancelled"];

export async function fitView(view, id) {
  view.show("Fit", h("p", { class: "note" }, "Loading …"));
  const fit = await api.fit(id);
  if (ENDED.includes(fit.state)) return ended(view, fit);
  running(view, fit);
}

function running(view, fit) {
  const card = new ProgressCard(fit, () => api.remove("fits", fit.id));
  view.atEnd(() => card.stop());
  const below = h("div", { class: "stack" });
  view.show(title(fit), heading(fit), card.element, below);
  const early = earlyResult(view, fit, below);
  const stop = follow(
    fit.id,
    (type, data) => {
      if (type === "progress") {
        card.progress(data);
        early.look(data.stage);
      }
      if (type === "state") {
        card.state(data);
        if (ENDED.includes(data.state)) {
          card.stop();
          finish(view, fit.id, early.compared);
          return "end";
        }
      }
      return null;
    },
    (error) => view.show(title(fit), heading(fit), problemCard(error)),
  );
  view.atEnd(stop);
}

/** Below the progress: the measured curves, and the report as soon as it is there. */
function earlyResult(view, fit, box) {
  let stage = "";
  let shown = false;
  let compared = null;
  api.measurement(fit.measurement).then(
    (m) => !shown && drawCurves(view, box, m.id, m.summary, () => !shown),
    () => {}, // the progress is what matters here
  );
  const look = async (now) => {
    // The report is written before the posterior is sampled and the pictures are made.
    if (shown || now === stage || now === "fit") return;
    stage = now;
    const found = await api.fit(fit.id).catch(() => null);
    if (shown || view.over || !found?.result || ENDED.includes(found.state)) return;
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

async function finish(view, id, before) {
  try {
    const fit = await api.fit(id);
    if (view.over) return;
    document.getElementById("announcer").textContent = `The fit is ${fit.state}.`;
    ended(view, fit, before);
    // A cancelled fit still writes down what it has.
    for (let k = 0; fit.state === "cancelled" && k < LOOKS; k += 1) {
      await new Promise((done) => setTimeout(done, LATER));
      const now = await api.fit(id);
      if (view.over) return;
      if (now.artefacts.length !== fit.artefacts.length) return ended(view, now, before);
    }
  } catch (error) {
    view.show("Fit", problemCard(error));
  }
}

function ended(view, fit, before = null) {
  const state = {
    failed: () => [problemCard({ fields: fit.problem ?? { title: "The fit failed" } })],
    cancelled: () => [
      h(
        "div",
        { class: "notice warm" },
        h("h2", {}, "Cancelled"),
        h(
          "p",
          {},
          fit.artefacts.length ? "What was finished until then is kept below." : "Nothing had been finished.",
        ),
      ),
    ],
    done: () => [],
  }[fit.state]();
  view.show(
    title(fit),
    heading(fit),
    state,
    fit.result?.results?.length ? resultParts(view, fit, new Comparison(fit, before)) : null,
    fit.artefacts.length ? downloads(fit) : null,
  );
}

const title = (fit) => fit.name || `Fit ${fit.id.slice(0, 8)}`;

function heading(fit) {
  const report = fit.artefacts?.find((a) => a.name === "report.json");
  return h(
    "div",
    { class: "card-head" },
    h(
      "div",
      {},
      h("h1", {}, title(fit)),
      h(
        "p",
        { class: "note" },
        `Submitted ${when(fit.created)} · `,
        h("a", { href: `#/measurements/${fit.measurement}` }, "the measurement, fit again"),
      ),
    ),
    report
      ? h(
          "div",
          { class: "tools" },
          h("button", { type: "button", onclick: () => download(fit, "report.json") }, "Report (JSON)"),
          h("button", { type: "button", onclick: () => download(fit, null) }, "Everything (zip)"),
        )
      : null,
  );
}
