/* What fits and charts have in common: they wait, run, are cancelled or end, and leave files. */

import { h } from "./dom.js";
import { download } from "./downloads.js";
import { follow } from "./events.js";
import { when } from "./format.js";
import { problemCard } from "./problem.js";
import { ProgressCard } from "./progress.js";

const LOOKS = 8;
const LATER = 2000;
const ENDED = ["done", "failed", "cancelled"];

export const hasEnded = (job) => ENDED.includes(job.state);

/**
 * A card with the progress of a job; `onprogress` hears of each step, `onend` of the end, `failed` of an error.
 */
export function watch(view, kind, job, { onprogress = () => {}, onend, failed }) {
  const card = new ProgressCard(kind, job);
  view.atEnd(() => card.stop());
  const hear = (type, data) => {
    if (type === "progress") {
      card.progress(data);
      onprogress(data);
    }
    if (type === "state") {
      card.state(data);
      if (hasEnded(data)) {
        card.stop();
        onend();
        return "end";
      }
    }
    return null;
  };
  view.atEnd(follow(kind, job.id, hear, failed));
  return card.element;
}

/** Load a job that has ended and `show` it; one that was cancelled still writes down what it has. */
export async function settle(view, noun, load, show) {
  try {
    const job = await load();
    if (view.over) return;
    document.getElementById("announcer").textContent = `The ${noun} is ${job.state}.`;
    show(job);
    for (let k = 0; job.state === "cancelled" && k < LOOKS; k += 1) {
      await new Promise((done) => setTimeout(done, LATER));
      const now = await load();
      if (view.over) return;
      if (now.artefacts.length !== job.artefacts.length) return show(now);
    }
  } catch (error) {
    view.show(noun, problemCard(error));
  }
}

/** Why there is no result, or not all of it; null where nothing went wrong. */
export function trouble(job, noun) {
  if (job.state === "failed") return problemCard({ fields: job.problem ?? { title: `The ${noun} failed` } });
  if (job.state !== "cancelled") return null;
  const kept = job.artefacts.length
    ? "What was finished until then is kept below."
    : "Nothing had been finished.";
  return h("div", { class: "notice warm" }, h("h2", {}, "Cancelled"), h("p", {}, kept));
}

/** Name, time, where its measurement is, and what is done with it: its main file `[name, words]` and `tools`. */
export function heading(kind, job, title, again, [main, words], tools = []) {
  const ready = job.artefacts?.some((a) => a.name === main);
  const save = (name) => () => download(kind, job.id, name);
  return h(
    "div",
    { class: "card-head" },
    h(
      "div",
      {},
      h("h1", {}, title),
      h(
        "p",
        { class: "note" },
        `Submitted ${when(job.created)}`,
        job.measurement ? [" · ", h("a", { href: `#/measurements/${job.measurement}` }, again)] : null,
      ),
    ),
    h(
      "div",
      { class: "tools" },
      tools,
      ready
        ? [
            h("button", { type: "button", onclick: save(main) }, words),
            h("button", { type: "button", onclick: save(null) }, "Everything (zip)"),
          ]
        : null,
    ),
  );
}
