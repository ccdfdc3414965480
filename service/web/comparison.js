/* Which two models and which channel the plots show, and what the service said of them. */

import * as api from "./api.js";
import { planeDirections, splitPlane, spread } from "./geometry.js";

const MOST = 10;

export class Comparison {
  #listeners = [];
  #answers = new Map();

  /** `before` is the comparison of an earlier state of the same fit, whose choices and answers are kept. */
  constructor(fit, before = null) {
    this.fit = fit;
    this.results = fit.result.results;
    this.channels = this.results[0].channels;
    this.channel = 0;
    this.a = fit.result.best ?? this.results[0].candidate;
    // The first other model of another kind: a variant of the best looks like it.
    const best = this.result("a");
    this.b =
      (this.results.find((r) => r.model !== best.model) ?? this.results.find((r) => r !== best))?.candidate ??
      "";
    if (before) {
      Object.assign(this, { a: before.a, b: before.b, channel: before.channel });
      this.#answers = before.#answers;
    }
  }

  onchange(listener) {
    this.#listeners.push(listener);
  }

  choose(which, candidate) {
    if (which === "a" && candidate === this.b) this.b = this.a;
    if (which === "b" && candidate === this.a) return this.#tell();
    this[which] = candidate;
    return this.#tell();
  }

  show(channel) {
    this.channel = channel;
    this.#tell();
  }

  #tell() {
    this.#listeners.forEach((listener) => listener());
  }

  result(which) {
    return this.results.find((r) => r.candidate === this[which]) ?? null;
  }

  /** The chosen models, as [which, candidate]. */
  get models() {
    return ["a", "b"].filter((which) => this.result(which)).map((which) => [which, this[which]]);
  }

  curves(candidate) {
    return this.#once(`curves ${candidate}`, async () => {
      const answer = await api.curves(this.fit.id, candidate);
      return { ...answer, curves: answer.curves.flatMap(splitPlane) };
    });
  }

  sphere(candidate) {
    return this.#once(`sphere ${candidate}`, async () => {
      // The service answers in turn, and the table of an anisotropic model takes longest: lines come first.
      await Promise.allSettled(this.models.flatMap(([, name]) => [this.curves(name), this.planes(name)]));
      return api.sphere(this.fit.id, candidate);
    });
  }

  /** The curves that are drawn: those in the plane of incidence where there are any. */
  async shown() {
    const { curves } = await this.curves(this.a);
    const plane = curves.filter((c) => c.plane && c.theta_o_deg.length > 2);
    const chosen = plane.length ? plane : curves;
    return { chosen, curves: spread(chosen, MOST).map((k) => chosen[k]) };
  }

  /** A model along the planes of the shown curves: {angles, values [channel][angle]} for each. */
  planes(candidate) {
    return this.#once(`planes ${candidate}`, async () => {
      const { curves } = await this.shown();
      const r = this.results.find((x) => x.candidate === candidate);
      const { angles, directions } = planeDirections(curves);
      const { values } = await api.evaluate({
        model: r.model,
        params: r.params,
        options: r.options,
        directions,
      });
      let start = 0;
      return angles.map((own) => {
        const end = start + own.length;
        const part = { angles: own, values: values.map((channel) => channel.slice(start, end)) };
        start = end;
        return part;
      });
    });
  }

  #once(key, load) {
    if (!this.#answers.has(key)) {
      const answer = load();
      this.#answers.set(key, answer);
      answer.catch(() => this.#answers.delete(key));
    }
    return this.#answers.get(key);
  }
}
