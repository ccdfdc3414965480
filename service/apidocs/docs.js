/* Lists the operations of /openapi.json: parameters, bodies, answers and examples. */

const METHODS = ["get", "post", "put", "patch", "delete"];

function h(name, fields, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(fields ?? {})) made.setAttribute(key, value);
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

function resolver(document_) {
  return (schema) => {
    let found = schema;
    while (found?.$ref) {
      found = found.$ref.slice(2).split("/").reduce((at, key) => at?.[key], document_);
    }
    return found ?? {};
  };
}

/** A schema in a few words. */
function words(schema, resolve) {
  if (schema.$ref) return schema.$ref.split("/").pop();
  const either = schema.anyOf ?? schema.oneOf;
  if (either) return [...new Set(either.map((one) => words(one, resolve)))].join(" or ");
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(", ");
  if (schema.const !== undefined) return JSON.stringify(schema.const);
  if (schema.type === "array") return schema.items ? `list of ${words(schema.items, resolve)}` : "list";
  const bounds = [];
  if (schema.minimum !== undefined) bounds.push(`≥ ${schema.minimum}`);
  if (schema.exclusiveMinimum !== undefined) bounds.push(`> ${schema.exclusiveMinimum}`);
  if (schema.maximum !== undefined) bounds.push(`≤ ${schema.maximum}`);
  if (schema.exclusiveMaximum !== undefined) bounds.push(`< ${schema.exclusiveMaximum}`);
  return [schema.format ?? schema.type ?? "any", ...bounds].join(" ");
}

function table(rows, heads) {
  return h("table", {}, h("thead", {}, h("tr", {}, ...heads.map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, ...rows.map((row) => h("tr", {}, ...row.map((cell) => h("td", {}, cell))))));
}

function fields(schema, resolve) {
  const found = resolve(schema);
  if (!found.properties) return null;
  const required = new Set(found.required ?? []);
  return table(
    Object.entries(found.properties).map(([name, field]) => [
      h("code", {}, name), words(field, resolve), required.has(name) ? "yes" : "",
      field.default === undefined ? "" : JSON.stringify(field.default), field.description ?? "",
    ]),
    ["Field", "Type", "Required", "Default", ""],
  );
}

function body(content, resolve) {
  return Object.entries(content ?? {}).flatMap(([type, { schema = {}, example }]) => {
    const shown = example ?? resolve(schema).examples?.[0];
    const text = typeof shown === "string" ? shown : JSON.stringify(shown, null, 2);
    return [h("p", {}, h("code", {}, type), " ", words(schema, resolve)), fields(schema, resolve),
      shown === undefined ? null : h("pre", {}, text)];
  });
}

function operation(method, path, found, resolve) {
  const parameters = found.parameters ?? [];
  const answers = Object.entries(found.responses).map(([status, { description, content }]) => [
    status, description ?? "",
    Object.entries(content ?? {}).map(([type, { schema = {} }]) => `${type}: ${words(schema, resolve)}`).join("; "),
  ]);
  return h("details", { id: `${method}${path}` },
    h("summary", {}, h("span", { class: "method" }, method.toUpperCase()), h("code", {}, path), ` ${found.summary ?? ""}`),
    found.description ? h("p", {}, found.description) : null,
    parameters.length ? h("h3", {}, "Parameters") : null,
    parameters.length
      ? table(parameters.map((one) => [h("code", {}, one.name), one.in, words(one.schema, resolve), one.description ?? ""]),
        ["Name", "In", "Type", ""])
      : null,
    found.requestBody ? h("h3", {}, "Body") : null,
    ...(found.requestBody ? body(found.requestBody.content, resolve) : []),
    h("h3", {}, "Answers"), table(answers, ["Status", "Meaning", "Content"]));
}

async function show() {
  const document_ = await (await fetch("/openapi.json")).json();
  const resolve = resolver(document_);
  document.getElementById("about").textContent = `${document_.info.description} Version ${document_.info.version}.`;
  const groups = new Map();
  for (const [path, methods] of Object.entries(document_.paths)) {
    for (const method of METHODS) {
      if (!methods[method]) continue;
      const tag = methods[method].tags?.[0] ?? "other";
      if (!groups.has(tag)) groups.set(tag, []);
      groups.get(tag).push(operation(method, path, methods[method], resolve));
    }
  }
  const main = document.getElementById("operations");
  main.replaceChildren(...[...groups].map(([tag, found]) => h("section", {}, h("h2", {}, tag), ...found)));
  document.getElementById("find").addEventListener("input", (event) => {
    const wanted = event.target.value.toLowerCase();
    for (const one of main.querySelectorAll("details")) one.hidden = !one.textContent.toLowerCase().includes(wanted);
  });
}

show().catch((error) => document.getElementById("operations").append(h("p", { role: "alert" }, String(error))));
