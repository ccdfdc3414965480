/* The charts that were made, newest first. */

import { card, h } from "./dom.js";
import { when } from "./format.js";
import { item, pages, stateChip } from "./past.js";

export async function chartsView(view) {
  const box = h("div");
  view.show(
    "Charts",
    h(
      "div",
      {},
      h("h1", {}, "Speed against accuracy"),
      h(
        "p",
        { class: "lead" },
        "A chart fits one measurement in many ways, scores each on directions that it did not see, and shows what a smaller error costs in time. The button that makes one is beside each measurement and each fit.",
      ),
    ),
    card("Charts", { id: "charts" }, box),
  );
  await pages(box, "charts", items);
}

function items(found) {
  if (!found.length)
    return h(
      "p",
      { class: "note" },
      "No chart was made yet. Open a measurement from ",
      h("a", { href: "#/past" }, "past fits"),
      ", or ",
      h("a", { href: "#/" }, "bring a new one"),
      ".",
    );
  return h(
    "ul",
    { class: "items plain" },
    found.map((chart) =>
      item(
        "charts",
        chart,
        chart.name || `Chart ${chart.id.slice(0, 8)}`,
        [chart.answer, when(chart.created)].filter(Boolean).join(" · "),
        stateChip(chart.state),
      ),
    ),
  );
}
