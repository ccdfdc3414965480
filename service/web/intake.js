/* Takes files from wherever they come: one becomes a measurement, several a batch of fits. */

import { simulate, submit, upload } from "./api.js";
import { fill, h } from "./dom.js";
import { bytes, count } from "./format.js";
import { problemCard } from "./problem.js";
import { keepUnread } from "./unread.js";

const AT_ONCE = 3;
const MOST = 1000;
// As long as the service keeps names of files.
const LONGEST = 120;
// Refusals that are about a file; with any other error the next file would fare no better.
const UNREADABLE = [400, 413, 415, 422];

export class Intake {
  #busy = false;

  /** What becomes of the files is shown in `answer`; `models()` gives the candidates of a batch. */
  constructor(view, answer, models) {
    Object.assign(this, { view, answer, models });
  }

  /** Take the files of a list; none is no mistake. */
  take(files) {
    const all = [...files];
    if (all.length > 1) return this.#work(() => this.#batch(all));
    if (all.length) return this.#work(() => this.#one(all[0]), all[0]);
    return null;
  }

  sample(sample) {
    return this.#work(async () => {
      this.#say(`Simulating ${sample.title} …`);
      return measurementPage(await upload(await simulate(sample.body), sample.name));
    });
  }

  async #one(file) {
    this.#say(`Reading and checking ${file.name} (${bytes(file.size)}) …`);
    return measurementPage(await upload(file, file.name));
  }

  /** Read all files, some at a time, and have those fitted that could be read. */
  async #batch(files) {
    if (files.length > MOST) throw new Error(`A batch has at most ${MOST} files, not ${files.length}.`);
    const read = files.map(() => null);
    let next = 0;
    let ended = 0;
    const reader = async () => {
      while (next < files.length && !this.view.over) {
        const k = next++;
        this.#say(
          `Reading and checking ${files[k].name} …`,
          ended / files.length,
          `${ended} of ${files.length}`,
        );
        try {
          read[k] = { name: files[k].name, found: await upload(files[k], files[k].name) };
        } catch (error) {
          if (!UNREADABLE.includes(error.status)) {
            next = files.length;
            throw error;
          }
          read[k] = { name: files[k].name, fields: error.fields };
        }
        ended += 1;
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, reader));
    if (this.view.over) return null;
    const good = read.filter((r) => r.found);
    const unread = read.filter((r) => r.fields);
    if (!good.length) {
      fill(
        this.answer,
        unread.map(({ name, fields }) =>
          problemCard({ fields: { ...fields, title: `${name}: ${fields.title}` } }),
        ),
      );
      return null;
    }
    const batch = await submit("batches", {
      name: `${label(good[0].name)} and ${count(good.length - 1, "other")}`,
      models: this.models(),
      items: good.map(({ name, found }) => ({ measurement: found.id, name: label(name) })),
    });
    keepUnread(batch.id, unread);
    return `#/batches/${batch.id}`;
  }

  #say(words, share = null, beside = "") {
    const bar = h("div");
    if (share !== null) bar.style.width = `${100 * share}%`;
    fill(
      this.answer,
      h(
        "div",
        { class: "notice" },
        h("p", {}, words, beside ? h("small", {}, ` ${beside}`) : null),
        h("div", { class: share === null ? "progress waiting" : "progress" }, bar),
      ),
    );
  }

  /** Do this, and go to the address that it gives. */
  async #work(work, file = null) {
    if (this.#busy) return;
    this.#busy = true;
    try {
      this.answer.scrollIntoView({ block: "nearest" });
      const address = await work();
      if (address && !this.view.over) window.location.hash = address;
    } catch (error) {
      fill(this.answer, problemCard(error, file));
    } finally {
      this.#busy = false;
      this.answer.scrollIntoView({ block: "nearest" });
    }
  }
}

/** What a fit of this file is called: any name can be a file's, but not a fit's. */
const label = (name) => [...name.replace(/\p{C}/gu, "?")].slice(0, LONGEST).join("");

const measurementPage = (found) => `#/measurements/${found.id}`;
