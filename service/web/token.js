/* The dialog that asks for a token where the service wants one. */

import { token } from "./api.js";
import { h } from "./dom.js";

let asking = null;

/** Ask once, however many requests were refused; resolves when a token was entered. */
export function askForToken(refused) {
  asking ??= ask(refused).finally(() => {
    asking = null;
  });
  return asking;
}

function ask(refused) {
  return new Promise((done) => {
    const input = h("input", { type: "password", autocomplete: "off", required: true, id: "token" });
    const dialog = h(
      "dialog",
      { "aria-labelledby": "token-title" },
      h(
        "form",
        {
          method: "dialog",
          onsubmit: () => {
            token.set(input.value.trim());
            dialog.close();
            dialog.remove();
            done();
          },
        },
        h("h2", { id: "token-title" }, "This service needs a token"),
        refused ? h("p", { class: "notice bad", role: "alert" }, "The service refused that token.") : null,
        h(
          "p",
          { class: "note" },
          "Whoever started the service with --token has it. It is kept until this tab is closed.",
        ),
        h("label", { class: "field", for: "token" }, h("span", { class: "label" }, "Token"), input),
        h("button", { class: "primary", type: "submit" }, "Continue"),
      ),
    );
    // Without a token nothing can be shown, so Escape must not leave an empty page behind.
    dialog.addEventListener("cancel", (event) => event.preventDefault());
    document.body.append(dialog);
    dialog.showModal();
    input.focus();
  });
}
