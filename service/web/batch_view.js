/* A batch: how far its fits are, what became of each, and its tables. */

import * as api from "./api.js";
import { batchWords, endedOf } from "./batch_words.js";
import { card, fill, h } from "./dom.js";
import { fileCard, save } from "./downloads.js";
import { count, duration, when } from "./format.js";
import { stateChip } from "./past.js";
import { pictureOf } from "./picture.js";
import { problemCard } from "./problem.js";
import { unreadOf } from "./unread.js";

const EVERY = 1500;
// A long list is asked for less often.
const PER_FIT = 10;
// More files with problems than this are folded away.
const FEW = 4;
const COUNTS = [
  ["done", "Fitted"],
  ["running", "Running"],
  ["queued", "Waiting"],
  ["failed", "Failed"],
  ["cancelled", "Cancelled"],
];
const FILES = ["table.csv", "parameters.csv", "summary.png"].map((name) => ({ name }));

const hasEnded = (batch) => ["done", "cancelled"].includes(batch.state);

export async function batchView(view, id) {
  view.show("Batch", h("p", { class: "note" }, "Loading …"));
  const batch = await api.get("batches", id);
  const progress = new BatchProgress(batch);
  const table = h("div", {}, h("p", { class: "note" }, "…"));
  const files = h("div", { class: "stack" });
  const title = batch.name || `Batch ${id.slice(0, 8)}`;
  view.show(
    title,
    h("div", {}, h("h1", {}, title), h("p", { class: "note" }, `Submitted ${when(batch.created)}`)),
    progress.element,
    unread(id),
    card("The files", { id: "items" }, table),
    files,
  );
  let timer = 0;
  view.atEnd(() => clearTimeout(timer));
  let before = "";
  let fits = [];
  async function look() {
    let now = null;
    try {
      now = await api.get("batches", id);
      if (view.over) return;
      progress.show(now);
      const counts = JSON.stringify(now.counts);
      if (counts !== before) {
        fits = await api.fitsOf(id);
        if (view.over) return;
        before = counts;
        fill(table, fitTable(fits));
      }
      if (hasEnded(now)) {
        if (fits.some((fit) => fit.best || fit.state === "failed")) fill(files, summary(id), filesOf(id));
        document.getElementById("announcer").textContent = `The batch is ${now.state}.`;
        return;
      }
    } catch (error) {
      // A refusal is final; a lost connection or a busy service is not.
      const passing = error.fields && (!error.status || error.status === 429 || error.status >= 500);
      if (!passing) return progress.fail(error);
    }
    if (!view.over) timer = setTimeout(look, Math.max(EVERY, PER_FIT * batch.total));
  }
  await look();
}

class BatchProgress {
  constructor(batch) {
    this.id = batch.id;
    this.parts = COUNTS.map(([state]) => h("div", { class: state }));
    this.bar = h(
      "div",
      { class: "progress parts", role: "progressbar", "aria-label": "Fits ended" },
      this.parts,
    );
    this.words = h("p", { "aria-live": "polite" });
    this.figures = h("dl", { class: "figures" });
    this.problem = h("div");
    this.button = h("button", { type: "button", class: "danger", onclick: () => this.#cancel() }, "Cancel");
    this.element = card(
      "Progress",
      { id: "progress", tools: [this.button] },
      this.bar,
      this.words,
      this.figures,
      this.problem,
    );
    this.show(batch);
  }

  show(batch) {
    const { counts, total } = batch;
    COUNTS.forEach(([state], k) => (this.parts[k].style.width = `${(100 * counts[state]) / (total || 1)}%`));
    this.bar.setAttribute("aria-valuemax", total);
    this.bar.setAttribute("aria-valuenow", endedOf(batch));
    fill(
      this.figures,
      COUNTS.filter(([state]) => counts[state] || state === "done").map(([state, words]) =>
        h("div", {}, h("dt", {}, words), h("dd", {}, counts[state].toLocaleString("en"))),
      ),
    );
    const over = hasEnded(batch);
    this.button.hidden = over;
    const left = batch.seconds_left;
    this.words.textContent = over
      ? `${batch.state === "cancelled" ? "Cancelled" : "All have ended"}: ${batchWords(batch)}.`
      : `${endedOf(batch)} of ${total} have ended${left ? `, about ${duration(Math.max(left, 1))} left` : ""}.`;
  }

  fail(error) {
    fill(this.problem, problemCard(error));
  }

  async #cancel() {
    this.button.disabled = true;
    try {
      await api.cancel("batches", this.id);
    } catch (error) {
      this.button.disabled = false;
      this.fail(error);
    }
  }
}

/** Files that were dropped with the others and are no measurements. */
function unread(id) {
  const found = unreadOf(id);
  if (!found.length) return null;
  const said = h(
    "div",
    { class: "stack close" },
    found.map(({ name, fields }) => problemCard({ fields: { ...fields, title: name, file: null } })),
  );
  return card(
    `${count(found.length, "file")} could not be read`,
    { id: "unread", note: "The others are fitted without them." },
    found.length > FEW ? h("details", {}, h("summary", {}, "Which, and why"), said) : said,
  );
}

function fitTable(fits) {
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": "Files and their fits" },
    h(
      "table",
      { class: "batch" },
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          ["File", "State", "Best model", "Verdict"].map((title, k) =>
            h("th", { scope: "col", class: k > 1 ? "narrow-off" : null }, title),
          ),
        ),
      ),
      h(
        "tbody",
        {},
        fits.map((fit) => {
          const said = firstSentence(fit.verdict ?? fit.problem?.detail ?? fit.problem?.title ?? "");
          return h(
            "tr",
            {},
            h(
              "th",
              { scope: "row" },
              h("a", { href: `#/fits/${fit.id}` }, fit.name || fit.id.slice(0, 8)),
              h("small", { class: "wide-off" }, said),
            ),
            h("td", {}, stateChip(fit.state)),
            h("td", { class: "narrow-off" }, fit.best ?? "–"),
            h("td", { class: "narrow-off" }, said),
          );
        }),
      ),
    ),
  );
}

const firstSentence = (text) => text.split(/(?<=\.) /)[0];

function summary(id) {
  const box = h("div", {}, h("p", { class: "note" }, "Drawing …"));
  pictureOf(
    api.file("batches", id, "summary.png"),
    "The batch: how well each file is described, and by what",
  ).then((picture) => fill(box, picture));
  return card("Summary", { id: "summary" }, box);
}

const filesOf = (id) => fileCard(FILES, async (name) => save(await api.file("batches", id, name), name));
