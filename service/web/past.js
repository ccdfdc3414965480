/* Past fits, batches and stored measurements, newest first. */

import { list, remove } from "./api.js";
import { batchWords } from "./batch_words.js";
import { card, fill, h } from "./dom.js";
import { bytes, count, when } from "./format.js";
import { problemCard } from "./problem.js";

const CHIP = { done: "good", failed: "bad", cancelled: "warm" };

export const stateChip = (state) => h("span", { class: `chip ${CHIP[state] ?? ""}` }, state);

export async function pastView(view) {
  const [fits, batches, measurements] = ["", "", ""].map(() => h("div"));
  view.show(
    "Past fits",
    h("h1", {}, "Past fits"),
    h(
      "div",
      { class: "halves" },
      card("Fits", { id: "fits" }, fits),
      h(
        "div",
        { class: "stack" },
        card("Batches", { id: "batches", note: "Of several files that were dropped at once." }, batches),
        card("Measurements", { id: "measurements" }, measurements),
      ),
    ),
  );
  await Promise.all([
    pages(fits, "fits", fitItems),
    pages(batches, "batches", batchItems),
    pages(measurements, "measurements", measurementItems),
  ]);
}

/** Show one page of a list and a button for the next, until there is none. */
export async function pages(box, kind, items, cursor = null) {
  try {
    const { items: found, next } = await list(kind, cursor);
    const more = h(
      "button",
      { type: "button", onclick: () => (more.remove(), pages(box, kind, items, next)) },
      "Show more",
    );
    if (!cursor) fill(box, items(found));
    else box.append(items(found));
    if (next) box.append(more);
  } catch (error) {
    box.append(problemCard(error));
  }
}

/** A list of fits with their state and best model, which may be deleted there. */
export function fitItems(items, deletable = true) {
  if (!items.length) return h("p", { class: "note" }, "Nothing was fitted yet.");
  return h(
    "ul",
    { class: "items plain" },
    items.map((fit) =>
      item(
        "fits",
        fit,
        fit.name || fit.best || `Fit ${fit.id.slice(0, 8)}`,
        [fit.name && fit.best ? fit.best : null, when(fit.created)].filter(Boolean).join(" · "),
        stateChip(fit.state),
        deletable,
      ),
    ),
  );
}

function batchItems(items) {
  if (!items.length) return h("p", { class: "note" }, "None yet.");
  return h(
    "ul",
    { class: "items plain" },
    items.map((b) =>
      item(
        "batches",
        b,
        b.name || `Batch ${b.id.slice(0, 8)}`,
        `${batchWords(b)} · ${when(b.created)}`,
        stateChip(b.state),
      ),
    ),
  );
}

function measurementItems(items) {
  if (!items.length) return h("p", { class: "note" }, "Nothing was uploaded yet.");
  return h(
    "ul",
    { class: "items plain" },
    items.map((m) =>
      item(
        "measurements",
        m,
        m.name || m.id.slice(0, 12),
        `${count(m.summary.rows.used, "direction")} · ${bytes(m.bytes)} · ${when(m.created)}`,
      ),
    ),
  );
}

/** An entry of a list: a link, words about it, its state, and a button that deletes it. */
export function item(kind, resource, title, words, chip = null, deletable = true) {
  const erasable = deletable && !["queued", "running"].includes(resource.state);
  const row = h(
    "li",
    {},
    h("div", {}, h("a", { href: `#/${kind}/${resource.id}` }, title), h("small", {}, words)),
    h(
      "div",
      { class: "row" },
      chip,
      erasable
        ? h(
            "button",
            { type: "button", class: "quiet", "aria-label": `Delete ${title}`, onclick: forget },
            "Delete",
          )
        : null,
    ),
  );
  async function forget() {
    if (!window.confirm(`Delete ${title}? This cannot be undone.`)) return;
    try {
      await remove(kind, resource.id);
      row.remove();
    } catch (error) {
      row.append(problemCard(error));
    }
  }
  return row;
}
