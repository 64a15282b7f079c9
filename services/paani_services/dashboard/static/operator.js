// @ts-check
// The operator's controls: STOP is one press, sent until the server answers; arming is a hold that expires.

import { byId, fixed, setText } from "./text.js";

const HOLD_MS = 1000, EXPIRES_MS = 5000, RETRY_MS = 400;
let isStopPending = false, refusal = "", heldFrom = 0;
let token = document.querySelector('meta[name="paani-arm-token"]')?.getAttribute("content") ?? "";

/** Read the token again: a restarted server has another one. */
export async function renewToken() {
  const page = new DOMParser().parseFromString(await (await fetch("/")).text(), "text/html");
  token = page.querySelector('meta[name="paani-arm-token"]')?.getAttribute("content") ?? token;
}

export async function stop() {
  release(false);
  refusal = "";
  if (isStopPending) return;
  isStopPending = true;
  while (isStopPending) {
    try {
      if ((await fetch("/api/stop", { method: "POST" })).ok) isStopPending = false;
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
    refusal = answer.ok ? "" : (await answer.json()).error;
  } catch {
    refusal = "not sent: no connection to the dashboard";
  }
}

/** @param {boolean} mayArm */
function release(mayArm) {
  const heldMs = performance.now() - heldFrom;
  if (heldFrom && mayArm && heldMs >= HOLD_MS && heldMs <= EXPIRES_MS) void arm(heldMs);
  heldFrom = 0;
}

export function bindOperatorControls() {
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
    refusal = "";
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
export function renderOperatorState(store, open, now) {
  const operator = store.get("dashboard/operator"), state = /** @type {HTMLElement} */ (document.querySelector(".order-state"));
  const heldMs = heldFrom ? now - heldFrom : 0;
  if (heldMs > EXPIRES_MS) heldFrom = 0;
  const button = byId("arm");
  button.disabled = !open || !operator || operator.armed;
  button.querySelector("i").style.width = `${Math.min(1, heldMs / HOLD_MS) * 100}%`;
  setText(button.querySelector("span"), heldMs >= HOLD_MS ? "Release to arm" : operator?.armed ? "Armed" : "Hold to arm");
  byId("stop").dataset.latched = String(Boolean(operator?.stopped));
  state.dataset.state = isStopPending || operator?.stopped ? "stopped" : operator?.armed ? "armed" : "";
  setText(byId("order-word"), isStopPending ? "STOP REQUESTED" : !operator ? "–" : operator.stopped ? "STOPPED" : operator.armed ? "ARMED" : "NOT ARMED");
  setText(byId("order-detail"), refusal || (isStopPending ? "sending to the dashboard" : detail(operator, open)));
}

/** @param {any} operator @param {boolean} open */
function detail(operator, open) {
  if (!operator) return "operator state unknown";
  if (!open) return "last known state";
  if (!operator.stopped) return operator.armed ? "thrust allowed" : "thrust not allowed";
  if (operator.confirmed_ms !== null) return `plant at zero in ${fixed(operator.confirmed_ms, 0)} ms`;
  return operator.asked ? "plant has not confirmed" : "latched before this start";
}
