/* Live progress of a fit or a chart: the stage, what is done in it, and the time left. */

import { cancel } from "./api.js";
import { card, fill, h } from "./dom.js";
import { count, duration, figure } from "./format.js";
import { problemCard } from "./problem.js";

const STAGES = {
  fits: [
    ["queued", "Waiting"],
    ["fit", "Fitting candidates"],
    ["posterior", "Sampling the posterior"],
    ["files", "Writing files"],
  ],
  charts: [
    ["queued", "Waiting"],
    ["chart", "Measuring choices"],
  ],
};
const now = (label) => (label ? `; now ${label}` : "");
const SAID = {
  fit: (p) => `${p.done} of ${p.total} candidates done${now(p.label)}.`,
  chart: (p) =>
    p.total > 1 ? `${p.done} of ${p.total} choices measured${now(p.label)}.` : `Now ${p.label}.`,
  posterior: (p) =>
    `Step ${p.done.toLocaleString("en")} of at most ${p.total.toLocaleString("en")}; it stops when the chains have converged.`,
  files: (p) => (p.label ? `Writing ${p.label}.` : "Writing."),
};

export class ProgressCard {
  #left = null;
  #told = 0;
  #tried = new Set();

  /** `kind` is "fits" or "charts". */
  constructor(kind, job) {
    this.kind = kind;
    this.id = job.id;
    this.ladder = STAGES[kind].filter(([stage]) => stage !== "posterior" || job.request?.posterior);
    this.stages = h("ol", { class: "stages plain" });
    this.fill = h("div");
    this.bar = h(
      "div",
      { class: "progress waiting", role: "progressbar", "aria-label": "Progress of this stage" },
      this.fill,
    );
    this.words = h("p", { "aria-live": "polite" });
    this.figures = h("dl", { class: "figures" });
    this.tried = h("div", { class: "chips" });
    this.problem = h("div");
    this.button = h("button", { type: "button", class: "danger", onclick: () => this.#cancel() }, "Cancel");
    this.element = card(
      "Progress",
      { id: "progress", tools: [this.button] },
      this.stages,
      this.bar,
      this.words,
      this.figures,
      this.tried,
      this.problem,
    );
    this.clock = setInterval(() => this.#tick(), 1000);
    this.state(job);
    if (job.progress) this.progress(job.progress);
  }

  stop() {
    clearInterval(this.clock);
  }

  state(job) {
    if (job.state !== "queued") return;
    this.#stage("queued");
    this.words.textContent =
      job.position > 1 ? `${count(job.position - 1, "other job")} before this one.` : "Next in line.";
  }

  progress(p) {
    this.#stage(p.stage);
    const known = p.total > 1;
    this.bar.classList.toggle("waiting", !known);
    this.fill.style.width = known ? `${(100 * p.done) / p.total}%` : "";
    if (known) {
      this.bar.setAttribute("aria-valuemax", p.total);
      this.bar.setAttribute("aria-valuenow", p.done);
    } else this.bar.removeAttribute("aria-valuenow");
    this.#left = p.seconds_left;
    this.#told = performance.now();
    this.words.textContent = SAID[p.stage]?.(p) ?? p.label ?? "";
    if (p.stage === "fit" && p.label && !this.#tried.has(p.label)) {
      this.#tried.add(p.label);
      this.tried.lastElementChild?.classList.add("good");
      this.tried.append(h("span", { class: "chip" }, p.label));
    }
    if (p.stage !== "fit") this.tried.lastElementChild?.classList.add("good");
    const entries = [
      ["Running for", duration(p.seconds)],
      ["Left", null],
      ["Evaluations", p.evaluations?.toLocaleString("en")],
      ["Autocorrelation time", p.tau && `${figure(p.tau)} steps`],
      ["Acceptance", p.acceptance && `${figure(100 * p.acceptance, 2)} %`],
      ["Effective samples", p.ess && Math.round(p.ess).toLocaleString("en")],
    ].filter(([name, value]) => value || (name === "Left" && this.kind === "fits"));
    fill(
      this.figures,
      entries.map(([name, value]) => {
        const dd = h("dd", {}, value ?? "");
        if (name === "Left") this.leftCell = dd;
        return h("div", {}, h("dt", {}, name), dd);
      }),
    );
    this.#tick();
  }

  #stage(reached) {
    const at = this.ladder.findIndex(([stage]) => stage === reached);
    fill(
      this.stages,
      this.ladder.map(([, title], k) =>
        h("li", { class: k < at ? "done" : null, "aria-current": k === at ? "step" : null }, title),
      ),
    );
  }

  #tick() {
    if (!this.leftCell) return;
    const left =
      this.#left === null || this.#left === undefined
        ? null
        : this.#left - (performance.now() - this.#told) / 1000;
    this.leftCell.textContent =
      left === null ? "not known yet" : `about ${duration(Math.max(Math.round(left), 1))}`;
  }

  async #cancel() {
    this.button.disabled = true;
    this.words.textContent = "Cancelling; what is finished is kept.";
    try {
      await cancel(this.kind, this.id);
    } catch (error) {
      this.button.disabled = false;
      fill(this.problem, problemCard(error));
    }
  }
}
