/* Spheres of the compared models under one movable light. */

import { card, fill, h } from "./dom.js";
import { problemCard } from "./problem.js";
import { renderer } from "./sphere_gl.js";

const STEP = 0.06;
const SECONDS = 9;

export function sphereCard(view, compared) {
  const body = h("div", { class: "stack" }, h("p", { class: "note" }, "Drawing …"));
  const gl = renderer();
  if (!gl) {
    fill(
      body,
      h(
        "p",
        {},
        "This browser has no WebGL2, so no spheres can be drawn. The other plots show the same models.",
      ),
    );
    return card("Sphere", { id: "sphere" }, body);
  }
  const state = { x: -0.3, y: 0.34, stops: -0.5, spheres: [], frame: 0, playing: false };

  function draw() {
    state.frame = 0;
    const light = lightOf(state.x, state.y);
    // pi: a perfectly white diffuse surface facing the light then has radiance 1.
    for (const { loaded, canvas } of state.spheres)
      gl.draw(loaded, canvas, light, Math.PI * 2 ** state.stops);
  }
  const later = () => (state.frame ||= requestAnimationFrame(draw));

  function move(x, y) {
    const r = Math.hypot(x, y);
    const keep = r > 0.95 ? 0.95 / r : 1;
    state.x = x * keep;
    state.y = y * keep;
    later();
  }

  async function load() {
    try {
      const tables = await Promise.all(
        compared.models.map(async ([which, name]) => [which, name, await compared.sphere(name)]),
      );
      state.spheres.forEach(({ loaded }) => gl.release(loaded));
      state.spheres = tables.map(([which, name, table]) => ({
        which,
        name,
        loaded: gl.upload(table),
        canvas: canvasOf(name, move, state),
      }));
      fill(
        body,
        h(
          "div",
          { class: "spheres" },
          state.spheres.map(({ which, name, canvas }) => {
            const dot = h("span", { class: "dot", "aria-hidden": "true" });
            dot.style.background = `var(--model-${which})`;
            return h("figure", {}, canvas, h("figcaption", {}, dot, name));
          }),
        ),
        controls,
        h("p", { class: "note" }, shown(tables[0][2].channels)),
      );
      draw();
    } catch (error) {
      fill(body, problemCard(error));
    }
  }

  const play = h(
    "button",
    { type: "button", "aria-pressed": "false", onclick: () => (state.playing ? pause() : sweep()) },
    "Move the light",
  );
  const controls = h(
    "div",
    { class: "row" },
    play,
    h(
      "label",
      { class: "row" },
      "Exposure",
      h("input", {
        type: "range",
        min: "-4",
        max: "4",
        step: "0.25",
        value: "-0.5",
        oninput: (e) => ((state.stops = Number(e.target.value)), later()),
      }),
    ),
  );

  function sweep() {
    state.playing = true;
    play.setAttribute("aria-pressed", "true");
    play.textContent = "Hold the light";
    const start = performance.now();
    const from = Math.atan2(state.y, state.x);
    const radius = Math.max(Math.hypot(state.x, state.y), 0.3);
    const turn = (now) => {
      if (!state.playing) return;
      const angle = from + (2 * Math.PI * (now - start)) / (1000 * SECONDS);
      state.x = radius * Math.cos(angle);
      state.y = radius * Math.sin(angle);
      draw();
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  function pause() {
    state.playing = false;
    play.setAttribute("aria-pressed", "false");
    play.textContent = "Move the light";
  }

  view.atEnd(() => {
    pause();
    cancelAnimationFrame(state.frame);
    state.spheres.forEach(({ loaded }) => gl.release(loaded));
  });
  let models = "";
  const changed = () => {
    // Another channel changes nothing here.
    const now = compared.models.join();
    if (now !== models) load();
    models = now;
  };
  compared.onchange(changed);
  changed();
  return card("Sphere", { id: "sphere" }, body);
}

/** The direction of a light whose mirror image stands at this place of the sphere's disc. */
function lightOf(x, y) {
  const z = Math.sqrt(Math.max(1 - x * x - y * y, 0));
  return [2 * z * x, 2 * z * y, 2 * z * z - 1];
}

function canvasOf(name, move, state) {
  const canvas = h("canvas", {
    role: "img",
    tabindex: "0",
    "aria-label": `A sphere of ${name} under one light; arrow keys move the light`,
    onpointerdown: (event) => (canvas.setPointerCapture(event.pointerId), follow(event)),
    onpointermove: (event) => event.buttons && follow(event),
    onkeydown: (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!step) return;
      event.preventDefault();
      move(state.x + STEP * step[0], state.y + STEP * step[1]);
    },
  });
  canvas.width = canvas.height = 640;
  function follow(event) {
    const box = canvas.getBoundingClientRect();
    // The disc ends a little inside the canvas.
    const place = (v, start, size) => (2.12 * (v - start)) / size - 1.06;
    move(place(event.clientX, box.left, box.width), -place(event.clientY, box.top, box.height));
  }
  return canvas;
}

function shown(channels) {
  const what =
    channels.length === 3 ? `${channels.join(", ")} as red, green, blue` : `${channels[0]} as grey`;
  return `One distant light and nothing else, ${what}. Drag on a sphere or use the arrow keys: the highlight follows.`;
}
