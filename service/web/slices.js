/* Measured against fitted along the plane of incidence, with the residuals below. */

import { card, fill, h, segmented } from "./dom.js";
import { percent } from "./format.js";
import { nameOf } from "./geometry.js";
import { colour, ordered } from "./palette.js";
import { AnglePlot, keys, legend } from "./plots.js";
import { problemCard } from "./problem.js";

const LOG_FROM = 1.2;
const FIRST = 6;

export function slicesCard(view, compared) {
  const box = h("div", { class: "stack" }, h("p", { class: "note" }, "Drawing …"));
  const log = (compared.fit.result.measurement.decades ?? 0) > LOG_FROM;
  let data = null;
  const curves = new AnglePlot(() => curveLines(data, compared), {
    label: "BRDF [1/sr]",
    log,
    sync: "slices",
    describe: "Measured and fitted BRDF over the viewing angle. Arrow keys read values.",
    hint: "Point or use the arrow keys to read values; drag to zoom, double-click to return.",
  });
  const residuals = new AnglePlot(() => residualLines(data, compared), {
    label: "measured / model − 1",
    height: 190,
    sync: "slices",
    format: (v) => percent(v),
    describe: "Relative residuals over the viewing angle. Arrow keys read values.",
  });
  view.atEnd(() => (curves.destroy(), residuals.destroy()));
  async function load() {
    try {
      const { chosen, curves: shown } = await compared.shown();
      const models = await Promise.all(
        compared.models.map(async ([which, name]) => ({
          which,
          name,
          curves: (await compared.curves(name)).curves,
          planes: await compared.planes(name),
        })),
      );
      const first = data === null;
      data = { all: chosen, shown, models };
      residuals.set({ symmetric: limit(data, compared.channel) });
      if (!first) return curves.draw();
      // Half a dozen colours are told apart; the others wait behind their buttons.
      shown.forEach((_, k) => {
        const visible = shown.length <= FIRST || k % Math.ceil(shown.length / FIRST) === 0;
        if (!visible) [curves, residuals].forEach((plot) => plot.toggle(k, false));
      });
      const groups = shown.map((c, k) => ({
        group: k,
        label: nameOf(c, chosen),
        stroke: () => ordered(k, shown.length),
      }));
      return fill(
        box,
        signs(),
        curves.element,
        legend("Incidences shown", groups, [curves, residuals]),
        h("h3", {}, "Residuals"),
        residuals.element,
      );
    } catch (error) {
      return fill(box, problemCard(error));
    }
  }
  compared.onchange(load);
  load();
  return card(
    "Measured against fitted",
    {
      id: "slices",
      tools: [
        segmented(
          "Scale of the values",
          [
            [true, "log"],
            [false, "linear"],
          ],
          log,
          (value) => curves.set({ log: value }),
        ),
      ],
    },
    box,
  );
}

function signs() {
  const dot = h("span", { class: "dot", "aria-hidden": "true" });
  dot.style.background = "currentColor";
  return keys([
    ["measured", dot],
    ["model A", "none"],
    ["model B", "4 4"],
    ["colours are incidences", null],
  ]);
}

function curveLines(data, compared) {
  if (!data) return [];
  const k = compared.channel;
  return data.shown.flatMap((curve, group) => {
    const stroke = ordered(group, data.shown.length);
    const name = nameOf(curve, data.all);
    const fitted = data.models.map(({ which, planes, curves }) => {
      const b = which === "b";
      const common = {
        group,
        label: `${which.toUpperCase()} ${name}`,
        stroke,
        dash: b ? [5, 5] : undefined,
        width: b ? 1.3 : 2,
      };
      if (curve.plane) return { ...common, x: planes[group].angles, y: planes[group].values[k] };
      const own = same(curves, curve);
      return { ...common, x: own.theta_o_deg, y: own.fitted[k], points: true, hollow: true };
    });
    return [
      {
        group,
        label: name,
        x: curve.theta_o_deg,
        y: curve.measured[k],
        stroke,
        points: true,
        size: 4.5,
        measured: true,
      },
      ...fitted,
    ];
  });
}

function residualLines(data, compared) {
  if (!data) return [];
  return data.models.flatMap(({ which, curves }) =>
    data.shown.map((curve, group) => ({
      group,
      label: `${which.toUpperCase()} ${nameOf(curve, data.all)}`,
      x: curve.theta_o_deg,
      y: relative(same(curves, curve), compared.channel),
      stroke: which === "a" ? colour("model-a") : colour("model-b"),
      points: true,
      size: which === "a" ? 5 : 3.5,
      hollow: which === "b",
    })),
  );
}

const same = (curves, curve) =>
  curves.find(
    (c) => c.theta_i_deg === curve.theta_i_deg && c.phi_i_deg === curve.phi_i_deg && c.plane === curve.plane,
  ) ?? curve;

const relative = (curve, k) =>
  curve.measured[k].map((m, j) =>
    m !== null && curve.fitted?.[k][j] > 0 ? m / curve.fitted[k][j] - 1 : null,
  );

/** The residual axis' end: a round number beyond nearly all points of both models, at most 100 %. */
function limit(data, channel) {
  const sizes = data.models
    .flatMap(({ curves }) => data.shown.flatMap((curve) => relative(same(curves, curve), channel)))
    .filter((v) => v !== null)
    .map(Math.abs)
    .sort((a, b) => a - b);
  const most = sizes[Math.floor(0.98 * (sizes.length - 1))] ?? 0.1;
  return [0.05, 0.1, 0.2, 0.5].find((round) => round >= most) ?? 1;
}
