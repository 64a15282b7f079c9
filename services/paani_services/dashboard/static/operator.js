// @ts-check
// The operator's controls: arming is a hold that expires; what became of a STOP is shown beside it.

import { findInhibits, isOfArming, isReplay } from "./inhibits.js";
import { bindKey, hadKey, post } from "./requests.js";
import { CONFIRM_MS, bindStop, pendingStop } from "./stop.js";
import { html, mount, signal } from "./templates.js";
import { ARM_TEXTS, ORDER_TEXTS, STAGES, byId, fixed, operatorText, setText, words } from "./text.js";
import { describeWheel } from "./wheel.js";

const HOLD_MS = 1000, EXPIRES_MS = 5000, REFRESH_MS = 150;
const MAX_UNDER_WAY = 3; // requests on a slow link; more would take the connection that a STOP needs
const remaining = signal("null");
let refusal = "", heldFrom = 0, press = 0, refreshing = 0, underWay = 0;

/** @param {string} act */
async function send(act) {
  underWay++;
  const refused = await post(`/api/arm/${act}`, { press });
  underWay--;
  if (!refused) return;
  refusal = refused;
  release(false);
}

function hold() {
  refusal = "";
  if (!hadKey()) return;
  press = 1 + Math.floor(Math.random() * 2 ** 50);
  heldFrom = performance.now();
  void send("hold");
  clearInterval(refreshing);
  refreshing = setInterval(() => underWay < MAX_UNDER_WAY && void send("hold"), REFRESH_MS);
}

/** @param {boolean} mayArm */
function release(mayArm) {
  clearInterval(refreshing);
  const heldMs = performance.now() - heldFrom;
  if (heldFrom && mayArm && heldMs < HOLD_MS) refusal = ARM_TEXTS.tooShort;
  else if (heldFrom && mayArm && heldMs <= EXPIRES_MS) void send("release");
  heldFrom = 0;
}

export function bindOperatorControls() {
  bindKey();
  bindStop(() => {
    release(false);
    refusal = "";
  });
  mount("#arm-reasons", () => remainingList(JSON.parse(remaining.value)));
  const button = byId("arm");
  button.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    hold();
    if (heldFrom) button.setPointerCapture(event.pointerId);
  });
  button.addEventListener("pointerup", () => release(true));
  button.addEventListener("pointercancel", () => release(false));
  button.addEventListener("contextmenu", (/** @type {Event} */ event) => event.preventDefault());
  button.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    if (event.key === "Enter" && !event.repeat) hold();
    if (event.key === "Enter") event.preventDefault();
  });
  button.addEventListener("keyup", (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && release(true));
  button.addEventListener("blur", () => release(false));
}

/** @param {import("./store.js").Store} store @param {boolean} open @param {number} now @param {boolean} isPast whether the page shows the past, from which nobody arms */
export function renderOperatorState(store, open, now, isPast) {
  const operator = store.get("operator/state"), state = /** @type {HTMLElement} */ (document.querySelector(".order-state"));
  const heldMs = heldFrom ? now - heldFrom : 0;
  if (heldMs > EXPIRES_MS) refusal = ARM_TEXTS.tooLong;
  if (heldMs > EXPIRES_MS || isPast) release(false);
  const button = byId("arm");
  const isHeard = open && store.isFresh("operator/state", now);
  if (isHeard && operator?.armed) refusal = ""; // of an earlier press, or of one that was answered late
  button.disabled = !isHeard || !operator || operator.armed || isReplay(store) || isPast;
  button.querySelector("i").style.width = `${Math.min(1, heldMs / HOLD_MS) * 100}%`;
  setText(button.querySelector("span"), heldMs >= HOLD_MS ? ARM_TEXTS.release : operator?.armed ? ARM_TEXTS.armed : ARM_TEXTS.hold);
  remaining.value = JSON.stringify(heldFrom ? findInhibits(store, now).filter((reason) => !isOfArming(reason)) : null);
  setText(byId("wheel"), describeWheel(isHeard ? operator : undefined).name);
  byId("stop").dataset.latched = String(Boolean(operator?.stopped));
  const stated = pendingStop(now, 1000 * store.ageS("operator/state", now)) ?? (isReplay(store) ? { state: "", word: ORDER_TEXTS.readOnly, detail: ORDER_TEXTS.played } : operatorState(operator, isHeard, store.ageS("operator/state", now)));
  state.dataset.state = stated.state;
  setText(byId("order-word"), stated.word);
  setText(byId("order-detail"), refusal || stated.detail);
}

/** While the button is held: everything that would keep the boat still when it is armed. @param {import("./inhibits.js").StopReason[] | null} reasons null: it is not held */
function remainingList(reasons) {
  byId("arm-reasons").hidden = !reasons;
  return reasons && html`<li class="quiet">${reasons.length ? ARM_TEXTS.stands : ARM_TEXTS.nothing}</li>${reasons.map(({ stage, text }) => html`<li>${STAGES[stage][0]}: ${text}</li>`)}`;
}

/** @param {any} operator @param {boolean} isHeard @param {number} ageS */
function operatorState(operator, isHeard, ageS) {
  if (!operator) return { state: "", word: "–", detail: ORDER_TEXTS.unknown };
  const word = operator.stopped ? ORDER_TEXTS.stopped : operator.armed ? ORDER_TEXTS.armed : ORDER_TEXTS.notArmed, state = operator.stopped ? "stopped" : operator.armed ? "armed" : "";
  if (!isHeard) return { state: "", word, detail: ORDER_TEXTS.lastKnown };
  if (!operator.stopped) return { state, word, detail: operator.armed ? `${ORDER_TEXTS.by} ${operatorText(operator.by)}, ${words(operator.mode)}` : ORDER_TEXTS.noThrust };
  if (operator.confirmed_us && !operator.latch_kept) return { state, word, detail: ORDER_TEXTS.notWritten };
  if (operator.confirmed_us) return { state, word, detail: ORDER_TEXTS.confirmed(fixed((operator.confirmed_us - operator.asked_us) / 1000, 0)) };
  if (!operator.asked_us) return { state, word, detail: ORDER_TEXTS.before };
  const waitedMs = (operator.sent_us - operator.asked_us) / 1000 + ageS * 1000;
  if (waitedMs <= CONFIRM_MS) return { state: "asked", word: ORDER_TEXTS.asked, detail: ORDER_TEXTS.waiting };
  return { state: "unconfirmed", word: ORDER_TEXTS.notConfirmed, detail: ORDER_TEXTS.noZero };
}
