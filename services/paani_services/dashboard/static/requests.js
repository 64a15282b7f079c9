// @ts-check
// Requests of the operator's page: with the operator's key, or where a login was asked by the session that it began.

import { REQUEST_TEXTS, byId } from "./text.js";

/** Each page is a hand of its own at the wheel, until it is loaded again. */
export const hand = 1 + Math.floor(Math.random() * 2 ** 50);
/** A request that nobody answers is given up, or it would hold one of the few connections that a STOP needs too. */
const ANSWER_MS = 5000;
let hasSession = false;
let key = sessionStorage.getItem("paani-key") ?? "";

/** The operator's key comes after the address (`#key=...`), from where no server and no log sees it. */
function takeKey() {
  const given = new URLSearchParams(location.hash.slice(1)).get("key");
  if (!given) return;
  keepKey(given);
  history.replaceState(null, "", location.pathname);
}

/** @param {string} text */
function keepKey(text) {
  key = text.trim();
  sessionStorage.setItem("paani-key", key);
}

/** To the login where there has to be one, and is none any more. */
export async function requireSession() {
  try {
    const answer = await fetch("/api/session");
    if (answer.status === 401) location.assign("/login");
    else hasSession = (await answer.json()).login;
  } catch { /* no connection: asked again with the next one */ }
  byId("logout").hidden = !hasSession;
}

async function logOut() {
  await post("/api/logout", {});
  location.assign("/login");
}

export function bindKey() {
  takeKey();
  addEventListener("hashchange", takeKey);
  byId("logout").addEventListener("click", () => void logOut());
}

/** Whether there is a key; asks for one where there is none. */
export function hasKey() {
  if (hasSession) return true;
  if (!key) keepKey(prompt(REQUEST_TEXTS.askKey) ?? "");
  return Boolean(key);
}

/** Whether there was a key already. Whoever is asked for one has let go of what was held, of which the page hears nothing. */
export function hadKey() {
  const had = hasSession || Boolean(key);
  return hasKey() && had;
}

/**
 * Send a request; why it was refused, empty where it was not. A key that is refused is forgotten.
 * @param {string} path @param {object} body @param {boolean} [isLast] it is sent although the page goes away @param {number} [limitMs]
 */
export async function post(path, body, isLast = false, limitMs = ANSWER_MS) {
  try {
    const answer = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Paani-Key": key },
      body: JSON.stringify(body),
      keepalive: isLast,
      signal: AbortSignal.timeout?.(limitMs),
    });
    if (answer.ok) return "";
    if (answer.status === 401) void requireSession();
    if (answer.status === 403) keepKey("");
    return String((await answer.json()).error);
  } catch (error) {
    return error instanceof DOMException && error.name === "TimeoutError" ? REQUEST_TEXTS.noAnswer : REQUEST_TEXTS.notSent;
  }
}
