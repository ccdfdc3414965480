/* The table of ranked models. */

import { h } from "./dom.js";
import { figure } from "./format.js";

const MOST = 8;

/** What to look at before trusting a result, a few words each. */
export function flags(r) {
  const said = [];
  if (r.diagnostics.misfit_limited) said.push("misfit-limited");
  if (!r.plausibility.conserves_energy) said.push("albedo > 1");
  if (!r.plausibility.reciprocal) said.push("not reciprocal");
  for (const [status, words] of [
    ["lower", "at lower bound"],
    ["upper", "at upper bound"],
    ["undetermined", "undetermined"],
  ]) {
    const names = new Set(r.estimates.filter((e) => e.status === status).map((e) => e.name));
    names.forEach((name) => said.push(`${name} ${words}`));
  }
  if (!r.stop.converged) said.push("not converged");
  return said;
}

export function ranking(report, compared) {
  const given = report.results[0].noise.given;
  const rows = report.results.map((r) => row(r, report, compared, given));
  const mark = () =>
    rows.forEach(({ element, buttons }, k) => {
      for (const which of ["a", "b"]) {
        const on = compared[which] === report.results[k].candidate;
        element.classList.toggle(which, on);
        buttons[which].setAttribute("aria-pressed", on);
      }
    });
  compared.onchange(mark);
  mark();
  const heads = [
    ["#", "narrow-off"],
    ["Model", ""],
    ["Compare", ""],
    ["Parameters", "number narrow-off"],
    ["BIC above the lowest", "number"],
    ["rmse [1/sr]", "number narrow-off"],
    [given ? "red. chi²" : "log10 rms", "number narrow-off"],
    ["Max albedo", "number narrow-off"],
    ["Cautions", "narrow-off"],
  ];
  const folded = rows.length > MOST + 2 ? rows.slice(MOST) : [];
  folded.forEach(({ element }) => (element.hidden = true));
  const unfold = h(
    "button",
    {
      type: "button",
      onclick: () => {
        folded.forEach(({ element }) => (element.hidden = false));
        unfold.remove();
        folded[0].buttons.a.focus();
      },
    },
    `Show all ${rows.length} models`,
  );
  return [
    h(
      "div",
      { class: "scroll ranking", tabindex: "0", role: "region", "aria-labelledby": "ranking" },
      h(
        "table",
        {},
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            heads.map(([title, kind]) => h("th", { scope: "col", class: kind }, title)),
          ),
        ),
        h(
          "tbody",
          {},
          rows.map((r) => r.element),
        ),
      ),
    ),
    folded.length ? h("div", {}, unfold) : null,
    report.failed.length
      ? h(
          "details",
          {},
          h("summary", {}, `${report.failed.length} could not be fitted`),
          h(
            "ul",
            {},
            report.failed.map((f) => h("li", {}, h("strong", {}, f.candidate), `: ${f.reason}`)),
          ),
        )
      : null,
  ];
}

function row(r, report, compared, given) {
  const pick = (which) =>
    h(
      "button",
      {
        type: "button",
        class: which,
        "aria-label": `Show ${r.candidate} as model ${which.toUpperCase()}`,
        onclick: (event) => {
          event.stopPropagation();
          compared.choose(which, r.candidate);
        },
      },
      which.toUpperCase(),
    );
  const buttons = { a: pick("a"), b: pick("b") };
  const d = r.diagnostics;
  const element = h(
    "tr",
    { class: r.candidate === report.best ? "best" : null, onclick: () => compared.choose("a", r.candidate) },
    h("td", { class: "narrow-off" }, String(r.rank)),
    h(
      "th",
      { scope: "row" },
      h(
        "span",
        { class: "row" },
        r.candidate,
        r.candidate === report.best
          ? h("span", { class: "chip good" }, report.described ? "recommended" : "closest")
          : null,
      ),
      h("small", { class: "narrow-off" }, r.title),
      chips(r, "wide-off"),
    ),
    h("td", {}, h("span", { class: "pick" }, buttons.a, buttons.b)),
    h("td", { class: "number narrow-off" }, String(r.n_parameters)),
    h("td", { class: "number" }, r.bic_difference === null ? "–" : above(r.bic_difference)),
    h("td", { class: "number narrow-off" }, figure(r.rmse)),
    h(
      "td",
      { class: "number narrow-off" },
      given ? figure(d.reduced_chi_square) : d.log10_rms === null ? "–" : d.log10_rms.toFixed(3),
    ),
    h("td", { class: "number narrow-off" }, Math.max(...r.plausibility.albedo_max).toFixed(3)),
    h("td", { class: "narrow-off" }, chips(r)),
  );
  return { element, buttons };
}

const above = (bic) =>
  bic.toLocaleString("en", {
    minimumFractionDigits: bic < 1000 ? 1 : 0,
    maximumFractionDigits: bic < 1000 ? 1 : 0,
  });

function chips(r, kind = "") {
  const said = flags(r).map((text) => h("span", { class: "chip warm" }, text));
  return said.length ? h("span", { class: `chips ${kind}` }, said) : null;
}
