/* The service's HTTP interface. Every failure is a Problem with the fields of RFC 9457. */

const ROOT = new URL("v1/", document.baseURI);
const KEY = "lobefit-token";

/** What the service answered when it refused, or what kept an answer from coming. */
export class Problem extends Error {
  constructor(fields) {
    super(fields.detail || fields.title);
    this.fields = fields;
    this.status = fields.status ?? 0;
  }
}

// A token lives as long as the tab: no other visitor of the browser finds it.
export const token = {
  get: () => sessionStorage.getItem(KEY) ?? "",
  set: (value) => (value ? sessionStorage.setItem(KEY, value) : sessionStorage.removeItem(KEY)),
};

let askForToken = null;
/** Name the function that asks a person for a token and gives a promise of it. */
export function onUnauthorized(ask) {
  askForToken = ask;
}

const address = (path) => new URL(path, ROOT);

/** Send a request; the answer is a Response with a status below 400. */
export async function request(path, options = {}) {
  const headers = new Headers(options.headers);
  if (token.get()) headers.set("Authorization", `Bearer ${token.get()}`);
  let response;
  try {
    response = await fetch(address(path), { ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem({
      title: "The service does not answer",
      detail: "Is it still running, and the network up?",
    });
  }
  if (response.status === 401 && askForToken && !options.unattended) {
    await askForToken(Boolean(token.get()));
    return request(path, options);
  }
  if (!response.ok) throw await problemOf(response);
  return response;
}

async function problemOf(response) {
  const plain = { status: response.status, title: response.statusText || `Status ${response.status}` };
  try {
    const fields = await response.json();
    return new Problem({ ...plain, ...fields });
  } catch {
    return new Problem(plain);
  }
}

const json = async (path, options) => (await request(path, options)).json();
const post = (path, body) =>
  request(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });

const KINDS = { gz: "application/gzip", binary: "application/octet-stream" };

export function upload(file, name) {
  const kind = KINDS[name.split(".").pop().toLowerCase()] ?? "text/csv";
  return json(`measurements?name=${encodeURIComponent(name)}`, {
    method: "POST",
    headers: { "Content-Type": kind },
    body: file,
  });
}

const path = (kind, id) => `${kind}/${encodeURIComponent(id)}`;
const page = (cursor) => (cursor ? `&cursor=${encodeURIComponent(cursor)}` : "");
const MOST = 200;
const of = (model) => `?model=${encodeURIComponent(model)}`;

/** One page of a list: kind is "measurements", "fits", "charts" or "batches". */
export const list = (kind, cursor) => json(`${kind}?limit=20${page(cursor)}`);
export const get = (kind, id) => json(path(kind, id));
export const submit = async (kind, body) => (await post(kind, body)).json();
export const remove = (kind, id) => request(path(kind, id), { method: "DELETE" });
/** End what has not ended; what has is kept. */
export const cancel = (kind, id) => request(`${path(kind, id)}?keep=true`, { method: "DELETE" });
/** A file of a fit, a chart or a batch. */
export const file = async (kind, id, name) => (await request(`${path(kind, id)}/${name}`)).blob();
export const artefact = (kind, id, name) => file(kind, id, `artefacts/${encodeURIComponent(name)}`);

export const table = (id) => json(`${path("measurements", id)}/table?max_points=20000`);
export const curves = (id, model) => json(`${path("fits", id)}/curves${of(model)}`);
export const sphere = (id, model) => json(`${path("fits", id)}/sphere${of(model)}`);
export const models = async () => (await json("models")).items;
export const evaluate = async (body) => (await post("evaluate", body)).json();
export const simulate = async (body) => (await post("simulate", body)).blob();

/** Every fit of a batch, in the order of submission. */
export async function fitsOf(batch) {
  const found = [];
  let cursor = null;
  do {
    const { items, next } = await json(
      `fits?limit=${MOST}&batch=${encodeURIComponent(batch)}${page(cursor)}`,
    );
    found.push(...items);
    cursor = next;
  } while (cursor);
  return found.reverse();
}

/** Whether the service can work, and on what; never asks for a token. */
export async function ready() {
  try {
    return await (await fetch(new URL("readyz", document.baseURI))).json();
  } catch {
    return { ready: false };
  }
}
