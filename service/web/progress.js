/* Live progress of a fit: the stage, the candidate or the chain, and the time left. */

import { card, fill, h } from "./dom.js";
import { count, duration, figure } from "./format.js";
import { problemCard } from "./problem.js";

const STAGES = [
  ["queued", "Waiting"],
  ["fit", "Fitting candidates"],
  ["posterior", "Sampling the posterior"],
  ["files", "Writing files"],
];

export class ProgressCard {
  #left = null;
  #told = 0;
  #tried = new Set();

  constructor(fit, cancel) {
    this.posterior = Boolean(fit.request?.posterior);
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
    this.button = h(
      "button",
      { type: "button", class: "danger", onclick: () => this.#cancel(cancel) },
      "Cancel",
    );
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
    this.state(fit);
    if (fit.progress) this.progress(fit.progress);
  }

  stop() {
    clearInterval(this.clock);
  }

  state(fit) {
    if (fit.state !== "queued") return;
    this.#stage("queued");
    this.words.textContent =
      fit.position > 0 ? `${count(fit.position, "fit")} before this one.` : "Next in line.";
  }

  progress(p) {
    this.#stage(p.stage);
    const known = p.total > 0;
    this.bar.classList.toggle("waiting", !known);
    this.fill.style.width = known ? `${(100 * p.done) / p.total}%` : "";
    if (known) {
      this.bar.setAttribute("aria-valuemax", p.total);
      this.bar.setAttribute("aria-valuenow", p.done);
    }
    this.#left = p.seconds_left;
    this.#told = performance.now();
    this.words.textContent =
      {
        fit: `${p.done} of ${p.total} candidates done${p.label ? `; now ${p.label}` : ""}.`,
        posterior: `Step ${p.done.toLocaleString("en")} of at most ${p.total.toLocaleString("en")}; it stops when the chains have converged.`,
        files: p.label ? `Writing ${p.label}.` : "Writing.",
      }[p.stage] ??
      p.label ??
      "";
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
    ].filter(([name, value]) => value || name === "Left");
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

  #stage(now) {
    const stages = STAGES.filter(([stage]) => stage !== "posterior" || this.posterior);
    const at = stages.findIndex(([stage]) => stage === now);
    fill(
      this.stages,
      stages.map(([, title], k) =>
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

  async #cancel(cancel) {
    this.button.disabled = true;
    this.words.textContent = "Cancelling; what is finished is kept.";
    try {
      await cancel();
    } catch (error) {
      this.button.disabled = false;
      fill(this.problem, problemCard(error));
    }
  }
}
