// @ts-check
// STOP is one press and is asked again until the server has it; arming is a hold that expires.

import { byId, fixed, setText } from "./text.js";

const HOLD_MS = 1000, EXPIRES_MS = 5000, RETRY_MS = 400;
let asking = false, refused = "", heldFrom = 0;
let token = document.querySelector('meta[name="paani-arm-token"]')?.getAttribute("content") ?? "";

/** A restarted server has another token. */
export async function renewToken() {
  const page = new DOMParser().parseFromString(await (await fetch("/")).text(), "text/html");
  token = page.querySelector('meta[name="paani-arm-token"]')?.getAttribute("content") ?? token;
}

export async function stop() {
  release(false);
  refused = "";
  if (asking) return;
  asking = true;
  while (asking) {
    try {
      if ((await fetch("/api/stop", { method: "POST" })).ok) asking = false;
    } catch {
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    }
  }
}

/** @param {number} heldMs */
async function arm(heldMs) {
  try {
    const answer = await fetch("/api/arm", {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Paani-Token": token },
      body: JSON.stringify({ held_ms: Math.round(heldMs) }),
    });
    refused = answer.ok ? "" : (await answer.json()).error;
  } catch {
    refused = "not sent";
  }
}

/** @param {boolean} wanted */
function release(wanted) {
  const heldMs = performance.now() - heldFrom;
  if (heldFrom && wanted && heldMs >= HOLD_MS && heldMs <= EXPIRES_MS) void arm(heldMs);
  heldFrom = 0;
}

export function bindOrders() {
  byId("stop").addEventListener("pointerdown", stop);
  byId("stop").addEventListener("click", stop);
  addEventListener("keydown", (event) => {
    if (event.code !== "Space" && event.key !== "Escape") return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) void stop();
  }, true);
  const button = byId("arm");
  button.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    button.setPointerCapture(event.pointerId);
    refused = "";
    heldFrom = performance.now();
  });
  button.addEventListener("pointerup", () => release(true));
  button.addEventListener("pointercancel", () => release(false));
  button.addEventListener("contextmenu", (/** @type {Event} */ event) => event.preventDefault());
  button.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    if (event.key === "Enter" && !event.repeat) heldFrom = performance.now();
    if (event.key === "Enter") event.preventDefault();
  });
  button.addEventListener("keyup", (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && release(true));
  button.addEventListener("blur", () => release(false));
}

/** @param {import("./store.js").Store} store @param {boolean} open @param {number} now */
export function renderOrders(store, open, now) {
  const word = store.get("dashboard/operator"), state = /** @type {HTMLElement} */ (document.querySelector(".order-state"));
  const heldMs = heldFrom ? now - heldFrom : 0;
  if (heldMs > EXPIRES_MS) heldFrom = 0;
  const button = byId("arm");
  button.disabled = !open || !word || word.armed;
  button.querySelector("i").style.width = `${Math.min(1, heldMs / HOLD_MS) * 100}%`;
  setText(button.querySelector("span"), heldMs >= HOLD_MS ? "Release to arm" : word?.armed ? "Armed" : "Hold to arm");
  byId("stop").dataset.latched = String(Boolean(word?.stopped));
  state.dataset.state = asking || word?.stopped ? "stopped" : word?.armed ? "armed" : "";
  setText(byId("order-word"), asking ? "STOP ASKED" : !word ? "–" : word.stopped ? "STOPPED" : word.armed ? "ARMED" : "NOT ARMED");
  setText(byId("order-detail"), refused || (asking ? "asking the dashboard" : detail(word, open)));
}

/** @param {any} word @param {boolean} open */
function detail(word, open) {
  if (!word) return "operator state unknown";
  if (!open) return "last known";
  if (!word.stopped) return word.armed ? "thrust allowed" : "thrust not allowed";
  if (word.confirmed_ms !== null) return `plant at zero in ${fixed(word.confirmed_ms, 0)} ms`;
  return word.asked ? "plant not confirmed" : "latched earlier";
}
