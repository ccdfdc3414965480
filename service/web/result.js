/* What came of a fit: the verdict, the ranking, one model's numbers, and plots of two models. */

import { card, fill, h, select } from "./dom.js";
import { duration } from "./format.js";
import { Comparison } from "./comparison.js";
import { parameterCard } from "./parameters.js";
import { polarCard } from "./polar.js";
import { posteriorCard } from "./posterior.js";
import { ranking } from "./ranking.js";
import { residualCard } from "./residual_map.js";
import { slicesCard } from "./slices.js";
import { sphereCard } from "./sphere.js";

export function resultParts(view, fit, compared = new Comparison(fit)) {
  const report = fit.result;
  const details = h("div", { class: "stack" });
  const show = () => fill(details, parameterCard(report, compared.result("a"), fit.posterior));
  compared.onchange(show);
  show();
  return [
    verdict(report),
    card(
      "The models, ranked",
      { id: "ranking", note: "A and B choose what the plots below compare." },
      ranking(report, compared),
    ),
    details,
    compareBar(compared),
    slicesCard(view, compared),
    h("div", { class: "halves" }, polarCard(view, compared), sphereCard(view, compared)),
    residualCard(view, compared),
    fit.posterior ? posteriorCard(view, fit) : null,
    about(report),
  ];
}

function verdict(report) {
  const { sentence } = report.choice ?? {};
  const start =
    sentence && report.verdict.endsWith(sentence)
      ? report.verdict.slice(0, -sentence.length).trim()
      : report.verdict;
  return h(
    "section",
    { class: `card verdict${report.described ? "" : " doubt"}`, "aria-labelledby": "verdict" },
    h(
      "h2",
      { id: "verdict", class: "eyebrow" },
      report.described ? "The verdict" : "The verdict: no candidate is good enough",
    ),
    h("p", { class: "said" }, start),
    sentence && start !== report.verdict ? h("p", {}, sentence) : null,
    report.choice?.note ? h("p", { class: "note" }, `${report.choice.note}.`) : null,
  );
}

function compareBar(compared) {
  const choices = compared.results.map((r) => [r.candidate, r.candidate]);
  const a = select(choices, compared.a, (name) => compared.choose("a", name));
  const b = select([["", "nothing"], ...choices], compared.b, (name) => compared.choose("b", name));
  const c = select(
    compared.channels.map((name, k) => [String(k), name]),
    String(compared.channel),
    (k) => compared.show(Number(k)),
  );
  compared.onchange(() => {
    a.value = compared.a;
    b.value = compared.b;
    c.value = String(compared.channel);
  });
  const swatch = (which) => {
    const dot = h("span", { class: "dot", "aria-hidden": "true" });
    dot.style.background = `var(--model-${which})`;
    return dot;
  };
  return h(
    "div",
    { class: "compare row", role: "group", "aria-label": "What the plots show" },
    h("label", {}, swatch("a"), "Model A", a),
    h("label", {}, swatch("b"), "with B", b),
    compared.channels.length > 1 ? h("label", {}, "Channel", c) : null,
  );
}

function about(report) {
  const { versions } = report;
  return h(
    "p",
    { class: "note" },
    `Metric ${report.metric}; ${duration(report.seconds)} on ${report.device}; `,
    Object.entries(versions)
      .filter(([, v]) => v)
      .map(([name, v]) => `${name} ${v}`)
      .join(", "),
    `; schema ${report.schema}.`,
  );
}
