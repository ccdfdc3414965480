/* The measured curves of an upload, a line per incidence. */

import { fill, h, segmented, select } from "./dom.js";
import { curvesOf, nameOf, spread } from "./geometry.js";
import { ordered } from "./palette.js";
import { AnglePlot, legend } from "./plots.js";

const MOST = 12;
const LOG_FROM = 1.2;

/** A plot with its controls; `decades` is how far the values span. */
export function measuredPlot(view, table, decades) {
  const all = curvesOf(table);
  const plane = all.filter((c) => c.plane && c.theta_o_deg.length > 2);
  // Curves in the plane say most; where there are none, points have to do.
  const curves = plane.length ? plane : all;
  const shown = spread(curves, MOST).map((k) => curves[k]);
  let channel = 0;
  const lines = () =>
    shown.map((curve, k) => ({
      group: k,
      label: nameOf(curve, curves),
      x: curve.theta_o_deg,
      y: curve.measured[channel],
      stroke: ordered(k, shown.length),
      points: !curve.plane || curve.theta_o_deg.length < 3,
      width: 1.6,
      measured: true,
    }));
  const log = decades > LOG_FROM;
  const plot = new AnglePlot(lines, {
    label: "BRDF [1/sr]",
    log,
    height: 340,
    describe: `Measured BRDF over the viewing angle, ${shown.length} incidences. Arrow keys read values.`,
    hint: "Point at the plot or use the arrow keys to read values; drag to zoom, double-click to return.",
  });
  view.atEnd(() => plot.destroy());
  const tools = [
    table.channels.length > 1
      ? h(
          "label",
          {},
          "Channel",
          select(
            table.channels.map((c, k) => [String(k), c]),
            "0",
            (k) => ((channel = Number(k)), plot.draw()),
          ),
        )
      : null,
    segmented(
      "Scale of the values",
      [
        [true, "log"],
        [false, "linear"],
      ],
      log,
      (value) => plot.set({ log: value }),
    ),
  ];
  const left = curves.length - shown.length;
  const words = [
    left ? `${left} more incidences are not drawn.` : "",
    plane.length && plane.length < all.length
      ? "Views outside the plane of incidence are fitted too, and not drawn here."
      : "",
    table.total > table.values[0].length
      ? `Drawn from ${table.values[0].length} of ${table.total} directions.`
      : "",
  ].filter(Boolean);
  const key = h("div", { class: "stack" });
  const groups = () =>
    fill(
      key,
      legend(
        "Incidences shown",
        lines().map((l) => ({ group: l.group, label: `theta_i ${l.label}`, stroke: () => l.stroke })),
        [plot],
      ),
    );
  groups();
  return {
    tools,
    content: [plot.element, key, words.length ? h("p", { class: "note" }, words.join(" ")) : null],
  };
}
