// @ts-check
// STOP: one press of the button, of Space, of Escape or of a gamepad's B, without login and key, asked until the server
// answers.

import { ORDER_TEXTS, byId, fixed } from "./text.js";

// A link that comes back after it was dead answers on a new connection long before it does on one from before.
const RETRY_MS = 400, ANSWER_MS = 2000, PAD_PERIOD_MS = 40;
const PAD_BUTTON = 1; // B of the standard layout, the circle of others
export const CONFIRM_MS = 1000; // a STOP that takes longer is said to be not confirmed
let presses = 0, latched = 0, askedAt = 0; // how often it was pressed, and of how many presses the server says that they are latched
let answeredAt = 0; // when the server said that a STOP is latched; 0 once the operator's process has spoken since

async function stop() {
  if (latched < presses++) return; // asked for below, as the boat may have been armed since the request that is under way
  askedAt = performance.now();
  while (latched < presses) {
    const asked = presses;
    try {
      if ((await fetch("/api/stop", { method: "POST", signal: AbortSignal.timeout?.(ANSWER_MS) })).ok) latched = asked, (answeredAt = performance.now());
    } catch { /* asked again below */ }
    if (latched < asked) await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
  }
}

/** @param {() => void} onAsk called at each press @param {() => void} [onLatched] called when the server says that it is latched */
export function bindStop(onAsk, onLatched = () => {}) {
  const press = () => {
    onAsk();
    void stop().then(() => latched < presses || onLatched());
  };
  byId("stop").addEventListener("pointerdown", press);
  byId("stop").addEventListener("click", press);
  addEventListener("keydown", (event) => {
    if (event.code !== "Space" && event.key !== "Escape") return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) press();
  }, true);
  bindPad(press);
}

/** In every mode, whoever holds the wheel. A button that is down when the gamepad appears counts as pressed. @param {() => void} press */
function bindPad(press) {
  let wasDown = false;
  setInterval(() => {
    const isDown = [...navigator.getGamepads()].some((pad) => pad?.buttons?.[PAD_BUTTON]?.pressed);
    if (isDown && !wasDown) press();
    wasDown = isDown;
  }, PAD_PERIOD_MS);
}

/** A STOP that the operator's process has not confirmed yet; null where there is none. @param {number} now @param {number} heardAgoMs since its newest word came */
export function pendingStop(now, heardAgoMs) {
  if (now - heardAgoMs >= answeredAt) answeredAt = 0;
  if (latched === presses && !answeredAt) return null;
  const waitedMs = now - askedAt;
  if (waitedMs <= CONFIRM_MS) return { state: "asked", word: ORDER_TEXTS.asked, detail: ORDER_TEXTS.askedAgo(fixed(waitedMs, 0)) };
  return { state: "unconfirmed", word: ORDER_TEXTS.notConfirmed, detail: ORDER_TEXTS.nobody(fixed(waitedMs / 1000, 0)) };
}
