/* The lobes of one incidence in polar coordinates, as they leave the surface. */

import { card, fill, h, redrawn, segmented, sharp } from "./dom.js";
import { figure } from "./format.js";
import { nameOf } from "./geometry.js";
import { colour } from "./palette.js";
import { problemCard } from "./problem.js";

const SCALES = { linear: (v) => v, root: (v) => Math.cbrt(v), log: null };
const DECADES = 3;
const KEY =
  "Dots are measured, filled is model A, dashed model B. The arrow is the light, the dotted line the mirror direction.";

export function polarCard(view, compared) {
  const canvas = h("canvas", { role: "img" });
  const box = h("div", { class: "plot" }, canvas);
  const body = h("div", { class: "stack" }, h("p", { class: "note" }, "Drawing …"));
  const words = h("output", { class: "readout" });
  const slider = h("input", {
    type: "range",
    min: "0",
    step: "1",
    "aria-label": "Incidence",
    oninput: () => draw(),
  });
  let scale = "root";
  let data = null;

  async function load() {
    try {
      const { chosen, curves } = await compared.shown();
      const models = await Promise.all(
        compared.models.map(async ([which, name]) => ({ which, name, planes: await compared.planes(name) })),
      );
      if (!data) {
        slider.max = curves.length - 1;
        slider.value = Math.min(2, curves.length - 1);
        fill(
          body,
          box,
          h("label", { class: "row" }, "Incidence", slider, words),
          h("p", { class: "note" }, KEY),
        );
        view.atEnd(redrawn(box, draw));
      }
      data = { all: chosen, curves, models };
      draw();
    } catch (error) {
      fill(body, problemCard(error));
    }
  }

  function draw() {
    if (!data || !box.clientWidth) return;
    const at = Number(slider.value);
    const curve = data.curves[at];
    const lobes = data.models.map(({ which, planes }) => ({
      which,
      ...planes[at],
      values: planes[at].values[compared.channel],
    }));
    const measured = curve.plane
      ? curve.theta_o_deg.map((angle, j) => [angle, curve.measured[compared.channel][j]])
      : [];
    const most = Math.max(...measured.map(([, v]) => v), ...lobes.flatMap((l) => l.values));
    words.textContent = `theta_i ${nameOf(curve, data.all)}, up to ${figure(most)} 1/sr`;
    slider.setAttribute("aria-valuetext", words.textContent);
    canvas.setAttribute("aria-label", `Polar lobes: ${words.textContent}`);
    paint(canvas, box.clientWidth, { curve, lobes, measured, most, radius: radiusOf(scale, most), scale });
  }

  compared.onchange(load);
  load();
  return card(
    "Lobes",
    {
      id: "lobes",
      tools: [
        segmented(
          "Radius",
          [
            ["linear", "linear"],
            ["root", "cube root"],
            ["log", "log"],
          ],
          scale,
          (value) => ((scale = value), draw()),
        ),
      ],
    },
    body,
  );
}

function radiusOf(scale, most) {
  const of = SCALES[scale];
  if (of) return (v) => (v > 0 ? of(v / most) : 0);
  return (v) => (v > 0 ? Math.max(1 + Math.log10(v / most) / DECADES, 0) : 0);
}

function paint(canvas, width, { curve, lobes, measured, most, radius, scale }) {
  const size = Math.min(width / 2 - 26, 300);
  const height = size + 46;
  const g = sharp(canvas, width, height);
  const [x0, y0] = [width / 2, height - 20];
  // The light comes from the left, as the negative angles lie there.
  const at = (angle, r) => [
    x0 + r * size * Math.sin((angle * Math.PI) / 180),
    y0 - r * size * Math.cos((angle * Math.PI) / 180),
  ];
  g.font = '11px system-ui, "DejaVu Sans", sans-serif';
  g.strokeStyle = colour("grid");
  g.fillStyle = colour("axis");
  g.lineWidth = 1;
  const rings = scale === "log" ? Array.from({ length: DECADES }, (_, k) => 10 ** -k) : [1, 0.5, 0.1];
  for (const ring of rings) {
    g.beginPath();
    g.arc(x0, y0, radius(ring * most) * size, Math.PI, 2 * Math.PI);
    g.stroke();
    g.textAlign = "left";
    g.fillText(figure(ring * most, 2), x0 + 4, y0 - radius(ring * most) * size - 3);
  }
  g.textAlign = "center";
  for (let angle = -90; angle <= 90; angle += 30) {
    g.beginPath();
    g.moveTo(x0, y0);
    g.lineTo(...at(angle, 1));
    g.stroke();
    const [x, y] = at(angle, 1.07);
    if (angle && Math.abs(angle) < 90) g.fillText(`${angle}°`, x, y + 4);
  }
  g.strokeStyle = colour("axis");
  g.beginPath();
  g.moveTo(x0 - size - 16, y0);
  g.lineTo(x0 + size + 16, y0);
  g.stroke();
  for (const { which, angles, values } of lobes) {
    const paintIt = colour(`model-${which}`);
    g.beginPath();
    g.moveTo(x0, y0);
    angles.forEach((angle, k) => g.lineTo(...at(angle, radius(values[k]))));
    g.closePath();
    g.globalAlpha = 0.16;
    g.fillStyle = paintIt;
    if (which === "a") g.fill();
    g.globalAlpha = 1;
    g.strokeStyle = paintIt;
    g.lineWidth = 2;
    g.setLineDash(which === "b" ? [5, 4] : []);
    g.stroke();
    g.setLineDash([]);
  }
  g.fillStyle = colour("ink");
  for (const [angle, value] of measured) {
    g.beginPath();
    g.arc(...at(angle, radius(value)), 2, 0, 2 * Math.PI);
    g.fill();
  }
  rays(g, at, curve.theta_i_deg);
}

/** The light that arrives and the mirror direction. */
function rays(g, at, theta) {
  g.strokeStyle = colour("light");
  g.fillStyle = colour("light");
  g.lineWidth = 2;
  const [fx, fy] = at(-theta, 1);
  const [tx, ty] = at(-theta, 0.03);
  g.beginPath();
  g.moveTo(fx, fy);
  g.lineTo(tx, ty);
  g.stroke();
  const along = Math.atan2(ty - fy, tx - fx);
  g.beginPath();
  g.moveTo(tx, ty);
  for (const side of [2.7, -2.7])
    g.lineTo(tx + 11 * Math.cos(along + side), ty + 11 * Math.sin(along + side));
  g.fill();
  g.lineWidth = 1;
  g.setLineDash([2, 4]);
  g.beginPath();
  g.moveTo(...at(theta, 0));
  g.lineTo(...at(theta, 1));
  g.stroke();
  g.setLineDash([]);
}
