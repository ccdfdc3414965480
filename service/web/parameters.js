/* One model's parameters with their intervals, and what to beware of. */

import { card, h } from "./dom.js";
import { figure, interval, percent, withError } from "./format.js";

const MARKS = { fixed: "held", tied: "tied", lower: "on its lower bound", upper: "on its upper bound" };

export function parameterCard(report, r, posterior) {
  const summary = posterior?.candidate === r.candidate ? posterior.summary : null;
  const options = Object.entries(r.options)
    .map(([name, choice]) => `${name} ${choice}`)
    .join(", ");
  return card(
    `${r.candidate}: parameters`,
    {
      id: "parameters",
      tools: [h("span", { class: "chip" }, summary ? "90 % intervals of the posterior" : "± standard error")],
    },
    h(
      "p",
      { class: "note" },
      `${r.title}. ${r.convention}${options ? `; ${options}` : ""}. ${r.formula_source}.`,
    ),
    beware(r, report),
    table(r, summary),
    h("p", { class: "note" }, noise(r)),
  );
}

function table(r, summary) {
  const names = [...new Set(r.estimates.map((e) => e.name))];
  const own = r.channels.length > 1 && r.estimates.some((e) => e.channel !== null);
  const shown = own ? r.channels : [""];
  const of = (name, channel) =>
    r.estimates.find((e) => e.name === name && (e.channel === null || !own || e.channel === channel));
  const units = r.estimates.some((e) => e.unit !== "1");
  const head = h(
    "tr",
    {},
    h("th", { scope: "col" }, "Parameter"),
    own && shown.length > 6 ? h("th", { scope: "col" }, "Channel") : null,
    shown.length > 6
      ? h("th", { scope: "col" }, "Value")
      : shown.map((c) => h("th", { scope: "col" }, c || "Value")),
    units ? h("th", { scope: "col" }, "Unit") : null,
    h("th", { scope: "col", class: "narrow-off" }, "Meaning"),
  );
  const about = (e) => [
    units ? h("td", {}, e.unit === "1" ? "–" : e.unit) : null,
    h("td", { class: "narrow-off" }, h("small", {}, e.meaning)),
  ];
  const rows = names.flatMap((name) => {
    const first = of(name, shown[0]) ?? r.estimates.find((e) => e.name === name);
    const shared = first.channel === null;
    if (shown.length > 6) {
      return (shared ? [first] : r.estimates.filter((e) => e.name === name)).map((e) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, name),
          h("td", {}, e.channel ?? "all"),
          h("td", {}, value(e, r, summary)),
          about(e),
        ),
      );
    }
    const cells = shared
      ? [h("td", { colspan: shown.length }, value(first, r, summary, own ? " in all channels" : ""))]
      : shown.map((c) => h("td", {}, of(name, c) ? value(of(name, c), r, summary) : "–"));
    return [h("tr", {}, h("th", { scope: "row" }, name), cells, about(first))];
  });
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-labelledby": "parameters" },
    h("table", {}, h("thead", {}, head), h("tbody", {}, rows)),
  );
}

/** A value, words after it, and what is known of it. */
function value(e, r, summary, words = "") {
  const [number, ...rest] = known(e, r, summary);
  return [number, words ? h("small", {}, words) : null, ...rest];
}

/** A value with its interval, error, limit or a word. */
function known(e, r, summary) {
  const limit = r.identifiability?.limits.find((l) => l.parameter === e.name && l.channel === e.channel);
  const drawn =
    summary?.[e.channel === null ? e.name : `${e.name}[${e.channel}]`] ??
    (r.channels.length === 1 ? summary?.[e.name] : null);
  if (drawn) {
    const [low, middle, high] = interval(drawn.q5, drawn.q50, drawn.q95);
    return [middle, h("small", { class: "interval" }, `${low}\u200a…\u200a${high}`)];
  }
  if (limit)
    return [
      figure(e.value),
      h("small", {}, ` ${limit.kind === "upper" ? "<" : ">"} ${figure(limit.value)} (95 %)`),
    ];
  if (e.status === "undetermined")
    return [figure(e.value, 2), " ", h("span", { class: "chip warm" }, "undetermined")];
  const bound = e.status === "lower" || e.status === "upper";
  const text = withError(e.value, bound ? null : e.standard_error);
  const mark = MARKS[e.status];
  return mark ? [text, " ", h("span", { class: bound ? "chip warm" : "chip" }, mark)] : [text];
}

/** Sentences with numbers about what somebody who uses this result must know. */
function beware(r, report) {
  const said = [];
  const { albedo_max: albedo, albedo_max_theta_i_deg: where, ...p } = r.plausibility;
  if (r.diagnostics.misfit_limited)
    said.push(`The model’s misfit limits the fit: ${r.diagnostics.misfit_reason}.`);
  if (!p.conserves_energy) {
    const k = albedo.indexOf(Math.max(...albedo));
    said.push(
      `Albedo ${albedo[k].toFixed(3)} above 1 in ${r.channels[k]} at theta_i ${Math.round(where[k])}°: more light leaves than arrives.`,
    );
  }
  if (!p.reciprocal)
    said.push(
      `Not reciprocal: f(i,o) and f(o,i) differ by up to ${percent(p.reciprocity_error)} of their sum.`,
    );
  if (!r.stop.converged) said.push(`The search did not converge: ${r.stop.reason}.`);
  said.push(...(r.identifiability?.sentences ?? []));
  const { worst, outliers } = r.diagnostics;
  const lists = [
    said.length
      ? h(
          "div",
          { class: "notice warm" },
          h("h3", {}, "Beware"),
          h(
            "ul",
            { class: "plain" },
            said.map((text) => h("li", {}, text)),
          ),
        )
      : null,
    worst.length || outliers.count
      ? h(
          "details",
          {},
          h("summary", {}, "Where it fits worst"),
          h(
            "ul",
            {},
            [...worst, ...outliers.examples].map((text) => h("li", {}, text)),
          ),
        )
      : null,
  ];
  if (
    !said.length &&
    r.candidate === report.best &&
    r.estimates.every((e) => ["free", "fixed", "tied"].includes(e.status))
  ) {
    lists.unshift(
      h(
        "p",
        { class: "row" },
        h("span", { class: "chip good" }, "plausible"),
        h(
          "span",
          {},
          `Reciprocal, conserves energy (largest albedo ${Math.max(...albedo).toFixed(3)}), and every parameter is determined.`,
        ),
      ),
    );
  }
  return lists;
}

function noise(r) {
  const { given, relative, additive } = r.noise;
  if (given) return `Noise: the given sigma; reduced chi-square ${figure(r.diagnostics.reduced_chi_square)}.`;
  if (r.bic === null) return "Noise: not estimated with this metric.";
  const scales = relative.map(
    (share, k) =>
      `${r.channels.length > 1 ? `${r.channels[k]} ` : ""}${share ? `${percent(share)} of the value and ` : ""}${figure(additive[k], 2)} 1/sr`,
  );
  return `Noise found: ${scales.slice(0, 3).join("; ")}${scales.length > 3 ? `; ${scales.length - 3} more in the report` : ""}.`;
}
