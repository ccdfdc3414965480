/* The findings of the plausibility checks, what is suspicious first. */

import { h } from "./dom.js";

const LOOK = { suspicious: "warm", "cannot tell": "", ok: "good" };

export function checkList(found) {
  if (!found) return [h("p", {}, "These data are too few to be checked.")];
  const { checks } = found;
  const of = (verdict) => checks.filter((c) => c.verdict === verdict);
  const suspicious = of("suspicious");
  const rest = [...of("cannot tell"), ...of("ok")];
  const words = suspicious.length
    ? `${suspicious.length} of ${checks.length} checks found something to look at before trusting a fit.`
    : `Nothing suspicious: ${of("ok").length} checks passed, ${of("cannot tell").length} cannot be judged from these directions.`;
  return [
    h("p", {}, words),
    suspicious.length ? list(suspicious) : null,
    h("details", {}, h("summary", {}, suspicious.length ? "The other checks" : "All checks"), list(rest)),
  ];
}

function list(checks) {
  return h(
    "ul",
    { class: "checks plain" },
    checks.map((c) =>
      h(
        "li",
        {},
        h("span", { class: `chip ${LOOK[c.verdict] ?? ""}` }, c.verdict),
        h(
          "span",
          {},
          h("strong", {}, `${c.name[0].toUpperCase()}${c.name.slice(1)}. `),
          c.sentence,
          c.remedy ? h("small", {}, `What helps: ${c.remedy}.`) : null,
        ),
      ),
    ),
  );
}
