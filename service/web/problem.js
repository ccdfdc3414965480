/* A problem as a person wants to read it: what, where in the file, and what to do. */

import { h } from "./dom.js";

const AROUND = 2;
const READABLE = 32e6;

/** A box for an error; `file` is the upload it is about, whose lines are then shown. */
export function problemCard(error, file = null) {
  const fields = error.fields ?? { title: "The page failed", detail: String(error?.message ?? error) };
  const box = h(
    "section",
    { class: "notice bad problem", role: "alert" },
    h("h2", {}, fields.title),
    h("p", {}, fields.detail),
    places(fields),
    fields.expected ? h("p", { class: "remedy" }, h("strong", {}, "Expected: "), fields.expected, ".") : null,
    (fields.errors ?? []).length
      ? h(
          "ul",
          {},
          fields.errors.map((e) => h("li", {}, h("code", {}, e.pointer), " ", e.detail)),
        )
      : null,
    fields.instance ? h("p", {}, h("small", {}, `Request ${fields.instance}`)) : null,
  );
  if (file && fields.row && file.size < READABLE && !/\.(gz|binary)$/i.test(file.name ?? "")) {
    excerpt(file, fields).then((lines) => box.querySelector(".where").after(lines));
  }
  return box;
}

function places(fields) {
  const known = [
    ["File", fields.file],
    ["Row", fields.row],
    ["Column", fields.column],
    ["Found", fields.text],
  ].filter(([, value]) => value !== null && value !== undefined && value !== "");
  if (!fields.row && !fields.column) return null;
  return h(
    "dl",
    { class: "where" },
    known.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, String(value)))),
  );
}

async function excerpt(file, fields) {
  const lines = (await file.text()).split(/\r\n|\n|\r/);
  const first = Math.max(fields.row - AROUND, 1);
  const shown = lines.slice(first - 1, fields.row + AROUND);
  return h(
    "ol",
    { class: "excerpt plain", "aria-label": `Lines around ${fields.row} of the file`, tabindex: "0" },
    shown.map((line, k) => {
      const number = first + k;
      const wrong = number === fields.row;
      return h(
        "li",
        { class: wrong ? "wrong" : null },
        h("span", {}, String(number)),
        h("span", {}, wrong ? marked(line, fields.text) : line.slice(0, 400)),
      );
    }),
  );
}

/** The line with the offending cell marked: a whole cell first, else the text anywhere. */
function marked(line, text) {
  if (!text) return line.slice(0, 400);
  let at = 0;
  for (const cell of line.split(/([,;\t])/)) {
    if (cell.trim() === text.trim()) return split(line, at + cell.indexOf(text.trim()), text.trim().length);
    at += cell.length;
  }
  at = line.indexOf(text);
  return at < 0 ? line.slice(0, 400) : split(line, at, text.length);
}

function split(line, at, length) {
  const start = Math.max(at - 200, 0);
  return [
    line.slice(start, at),
    h("mark", {}, line.slice(at, at + length)),
    line.slice(at + length, at + length + 200),
  ];
}
