/* Which view is shown for an address, the token's dialog and the line about the device. */

import { onUnauthorized, ready } from "./api.js";
import { batchView } from "./batch_view.js";
import { chartView } from "./chart_view.js";
import { chartsView } from "./charts.js";
import { fill, h } from "./dom.js";
import { fitView } from "./fit_view.js";
import { measurementView } from "./measurement_view.js";
import { pastView } from "./past.js";
import { problemCard } from "./problem.js";
import { startView } from "./start.js";
import { askForToken } from "./token.js";

const main = document.getElementById("main");
const ROUTES = [
  [/^#\/measurements\/([^/]+)$/, measurementView],
  [/^#\/fits\/([^/]+)$/, fitView],
  [/^#\/charts\/([^/]+)$/, chartView],
  [/^#\/charts$/, chartsView],
  [/^#\/batches\/([^/]+)$/, batchView],
  [/^#\/past$/, pastView],
];

let leave = () => {};

async function show() {
  leave();
  const hash = window.location.hash;
  const route = ROUTES.find(([pattern]) => pattern.test(hash));
  const view = new View();
  leave = () => view.end();
  document.querySelectorAll(".top nav a").forEach((a) => {
    const here = a.getAttribute("href") === (hash || "#/");
    if (here) a.setAttribute("aria-current", "page");
    else a.removeAttribute("aria-current");
  });
  try {
    const [make, id] = route ? [route[1], decodeURIComponent(route[0].exec(hash)[1] ?? "")] : [startView];
    await make(view, id);
  } catch (error) {
    view.show("Lobefit", problemCard(error), h("p", {}, h("a", { href: "#/" }, "Start again")));
  }
}

/** What a view draws into; nothing of a view that was left reaches the page. */
class View {
  #ends = [];
  #over = false;

  get over() {
    return this.#over;
  }

  /** Put the view's elements on the page; the heading gets the focus the first time. */
  show(title, ...children) {
    if (this.#over) return;
    const first = document.title !== `${title} · Lobefit`;
    document.title = `${title} · Lobefit`;
    fill(main, children);
    if (first) {
      main.focus({ preventScroll: true });
      window.scrollTo(0, 0);
    }
  }

  /** Run this when the view is left. */
  atEnd(stop) {
    if (this.#over) stop();
    else this.#ends.push(stop);
    return stop;
  }

  end() {
    this.#over = true;
    this.#ends.forEach((stop) => stop());
    this.#ends = [];
  }
}

async function device() {
  const line = document.getElementById("device");
  const found = await ready();
  line.className = `device ${found.ready ? "ready" : "down"}`;
  line.textContent = found.ready ? `Ready · ${found.device ?? "device"}` : "Not ready yet";
  setTimeout(device, found.ready ? 30000 : 2000);
}

// Followed as a link it would be an address of no view.
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
onUnauthorized(askForToken);
window.addEventListener("hashchange", show);
show();
device();
