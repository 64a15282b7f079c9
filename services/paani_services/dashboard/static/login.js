// @ts-check
// The login: the operator's key once, for a session that scripts cannot read. STOP works without it.

import "./page_text.js"; // before any script looks at what it says
import { bindPalette } from "./palette.js";
import { bindStop, pendingStop } from "./stop.js";
import { LOGIN_TEXTS, byId, setText } from "./text.js";

const RENDER_PERIOD_MS = 100;
let isLatched = false;

/** @param {string} key */
async function logIn(key) {
  try {
    const answer = await fetch("/api/login", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ key }) });
    if (answer.ok) location.replace("/");
    else setText(byId("login-note"), sentence(answer.status, (await answer.json()).error));
  } catch {
    setText(byId("login-note"), LOGIN_TEXTS.noConnection);
  }
}

/** @param {number} status @param {string} error */
const sentence = (status, error) => (status === 403 && error.startsWith("key") ? LOGIN_TEXTS.wrongKey : error);

/** A terminal's address has the key after `#`, from where no server and no log sees it. */
function takeKey() {
  const given = new URLSearchParams(location.hash.slice(1)).get("key");
  if (!given) return;
  history.replaceState(null, "", location.pathname);
  void logIn(given);
}

function renderStop() {
  const pending = pendingStop(performance.now(), 0);
  if (pending) isLatched = false;
  const note = byId("stop-note");
  note.dataset.state = pending?.state ?? (isLatched ? "stopped" : "");
  if (pending) setText(note, `${pending.word}: ${pending.detail}`);
  else if (isLatched) setText(note, LOGIN_TEXTS.latched);
}

byId("login").addEventListener("submit", (/** @type {Event} */ event) => {
  event.preventDefault();
  void logIn(byId("key").value.trim());
});
bindPalette();
bindStop(() => {}, () => { isLatched = true; });
setInterval(renderStop, RENDER_PERIOD_MS);
takeKey();
addEventListener("hashchange", takeKey);
