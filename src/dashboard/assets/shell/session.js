// This module handles the session of the reader. Where the server asks who calls, the reader signs in at the identity
// provider of the plant, where the server has one, or the form takes a token once. A cookie that no script can read
// stands for either from then on; the page keeps neither.

import { bringCsrfToken, get, identityProvider, send } from "./api.js";
import { h, notice } from "./dom.js";

const SESSION = "/v1/session";
// Who has a session, for as long as the page stands.
/** @type {string | null} */
let reader = null;
// The view that the reader left for the identity provider.
const LEFT = "greybox-left-view";

// Asks the server for the session and shows it; answers whether the reader may look at the page.
export async function isKnown() {
  try {
    greet((await get(SESSION)).data);
    goBack();
    return true;
  } catch (problem) {
    greet(null);
    return problem.status !== 401;
  }
}

/**
 * Answers whether the reader may change what the project has.
 *
 * @param {any} view
 */
export async function mayWrite(view) {
  const { data } = await get(SESSION, view.signal);
  return data.scope !== "read";
}

function leave() {
  sessionStorage.setItem(LEFT, location.hash);
  location.assign(identityProvider());
}

function goBack() {
  const view = sessionStorage.getItem(LEFT);
  sessionStorage.removeItem(LEFT);
  if (view && !location.hash) {
    history.replaceState(null, "", view);
  }
}

// The style hides what is for writers, of class `for-writers` or `danger`, from a reader who may only look.
function greet(session) {
  bringCsrfToken(session?.csrf_token ?? null);
  document.body.dataset.scope = session?.scope ?? "";
  const isPerson = session && session.who !== "local";
  reader = isPerson ? session.who : reader;
  const out = session?.csrf_token && h("button", { type: "button", onclick: signOut }, "Sign out");
  document
    .getElementById("who")
    .replaceChildren(
      ...(isPerson ? [`${session.who} · ${session.scope} in ${session.project} `, out].filter(Boolean) : []),
    );
}

async function signOut() {
  try {
    await send("DELETE", SESSION);
  } finally {
    location.reload();
  }
}

export function showSignIn(root, begin) {
  const outcome = notice();
  const wayIn = identityProvider();
  greet(null);
  const token = h("input", {
    type: "password",
    name: "token",
    required: true,
    size: "40",
    autocomplete: "current-password",
    spellcheck: "false",
  });
  const button = h(
    "button",
    { type: "submit", class: wayIn ? "" : "primary" },
    wayIn ? "Sign in with the token" : "Sign in",
  );
  const submit = async (event) => {
    event.preventDefault();
    button.disabled = true;
    try {
      const { data } = await send("POST", SESSION, { token: token.value });
      greet(data);
      root.replaceChildren();
      await begin();
    } catch (problem) {
      outcome.fail(
        problem.status === 401
          ? { message: "The server does not know this token, or it has ended." }
          : problem,
      );
      button.disabled = false;
      token.select();
    }
  };
  root.append(
    h("h1", { tabindex: "-1" }, "Sign in"),
    reader
      ? h(
          "p",
          { role: "status" },
          `The session of ${reader} is over: it lasts twelve hours, or until its token ends.`,
        )
      : "",
    h(
      "p",
      {},
      "This server asks who you are. Whoever runs it makes tokens with ",
      h("code", {}, "greybox token create"),
      wayIn ? ", and people sign in with their account of the plant." : ".",
    ),
    wayIn
      ? h(
          "p",
          {},
          h(
            "button",
            { type: "button", class: "primary", id: "way-in", onclick: leave },
            "Sign in with your account",
          ),
        )
      : "",
    h("form", { class: "sign-in fields", onsubmit: submit }, h("label", {}, "Token", token), button),
    outcome.place,
  );
}
