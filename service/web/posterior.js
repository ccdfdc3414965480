/* The posterior: whether its chains converged, its numbers, and the pictures made of it. */

import { artefact } from "./api.js";
import { card, fill, h, segmented } from "./dom.js";
import { count, duration, figure } from "./format.js";
import { pictureOf } from "./picture.js";

const PICTURES = [
  ["corner.png", "corner plot", "Every two parameters against each other, with their marginals"],
  ["trace.png", "chains", "Every parameter over the steps of the chains"],
  ["predictive.png", "predictions", "The measurement with what the posterior predicts"],
];

export function posteriorCard(view, fit) {
  const p = fit.posterior;
  const there = PICTURES.filter(([name]) => fit.artefacts.some((a) => a.name === name));
  const picture = h("div");
  const words = h("p", { class: "note", "aria-live": "polite" });
  const show = async (name) => {
    const [, , said] = PICTURES.find(([file]) => file === name);
    words.textContent = said;
    fill(picture, await pictureOf(artefact("fits", fit.id, name), said));
  };
  if (there.length) show(there[0][0]);
  return card(
    `Posterior of ${p.candidate}`,
    {
      id: "posterior",
      tools: there.length
        ? [
            segmented(
              "Picture",
              there.map(([name, title]) => [name, title]),
              there[0][0],
              show,
            ),
          ]
        : [],
    },
    h(
      "div",
      { class: p.converged ? "notice" : "notice warm" },
      h("p", {}, h("strong", {}, p.converged ? "Converged: " : "Not converged: "), `${p.reason}.`),
      h(
        "p",
        { class: "note" },
        `${count(p.ensembles, "ensemble")} of ${count(p.walkers, "walker")}, ${p.steps} steps after a warm-up of ${p.warm_up}, acceptance ${figure(p.acceptance, 2)}, ${duration(p.seconds)}.`,
      ),
    ),
    there.length ? [words, picture] : null,
    h("details", { open: !there.length }, h("summary", {}, "The numbers"), table(p)),
  );
}

function table(p) {
  const heads = ["mean", "sd", "5 %", "50 %", "95 %", "ESS bulk", "ESS tail", "R-hat"];
  const rows = Object.entries(p.summary).map(([name, s]) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, name),
      [
        figure(s.mean, 5),
        figure(s.sd, 2),
        figure(s.q5, 5),
        figure(s.q50, 5),
        figure(s.q95, 5),
        Math.round(s.ess_bulk ?? 0).toLocaleString("en"),
        Math.round(s.ess_tail ?? 0).toLocaleString("en"),
        s.r_hat?.toFixed(4) ?? "–",
      ].map((text) => h("td", { class: "number" }, text)),
      h("td", {}, h("small", {}, p.priors[name] ?? "")),
    ),
  );
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": "Numbers of the posterior" },
    h(
      "table",
      {},
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          h("th", { scope: "col" }, "Parameter"),
          heads.map((t) => h("th", { scope: "col", class: "number" }, t)),
          h("th", { scope: "col" }, "Prior"),
        ),
      ),
      h("tbody", {}, rows),
    ),
  );
}
