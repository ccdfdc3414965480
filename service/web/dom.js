/* Elements from plain values. Data reach the document as text nodes only, so nothing needs escaping. */

/** Make an element: `on...` keys are listeners, other keys attributes; null and false are left out. */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "value") element.value = value;
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  element.append(...children.flat(Infinity).filter((c) => c !== null && c !== undefined && c !== false));
  return element;
}

/** Put new children in place of the old ones. */
export function fill(element, ...children) {
  element.replaceChildren(...children.flat(Infinity).filter((c) => c !== null && c !== undefined));
  return element;
}

/** A titled box of the page. */
export function card(title, { id, tools = [], note = null, wide = false } = {}, ...children) {
  return h(
    "section",
    { class: wide ? "card wide" : "card", "aria-labelledby": id },
    h("header", { class: "card-head" }, h("h2", { id }, title), h("div", { class: "tools" }, tools)),
    note ? h("p", { class: "note" }, note) : null,
    children,
  );
}

/** A labelled control. */
export function field(label, control, hint = null) {
  return h(
    "label",
    { class: "field" },
    h("span", { class: "label" }, label),
    control,
    hint ? h("small", {}, hint) : null,
  );
}

/** A drop-down; `choices` are [value, words] pairs. */
export function select(choices, chosen, onchange, attributes = {}) {
  return h(
    "select",
    { ...attributes, onchange: (event) => onchange(event.target.value) },
    choices.map(([value, words]) => h("option", { value, selected: value === chosen }, words)),
  );
}

/** A row of buttons of which one is pressed. */
export function segmented(label, choices, chosen, onchange) {
  const buttons = choices.map(([value, words]) =>
    h("button", { type: "button", "aria-pressed": value === chosen, onclick: () => press(value) }, words),
  );
  function press(value) {
    buttons.forEach((b, k) => b.setAttribute("aria-pressed", choices[k][0] === value));
    onchange(value);
  }
  buttons.forEach((b, k) => b.setAttribute("aria-pressed", choices[k][0] === chosen));
  return h("div", { class: "segmented", role: "group", "aria-label": label }, buttons);
}

/** A canvas of `width` by `height` CSS pixels, sharp on dense screens, with its 2-D context. */
export function sharp(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}

/** Call `draw` now, when the element's width changes and when light turns dark; give a stop function. */
export function redrawn(element, draw) {
  let width = 0;
  const observer = new ResizeObserver(() => {
    if (element.clientWidth !== width && element.clientWidth > 0) {
      width = element.clientWidth;
      draw(width);
    }
  });
  const scheme = window.matchMedia("(prefers-color-scheme: dark)");
  const again = () => element.clientWidth > 0 && draw(element.clientWidth);
  observer.observe(element);
  scheme.addEventListener("change", again);
  return () => {
    observer.disconnect();
    scheme.removeEventListener("change", again);
  };
}
