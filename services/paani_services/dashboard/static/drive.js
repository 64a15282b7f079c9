// @ts-check
// The drive panel: modes and why they may not start, who holds the wheel, and driving by hand under a dead man's handle.
// Each page is a hand of its own. What it says is sent again and again while the stick or a key is held, and not at all
// by a page that is hidden or has lost its link: the operator's process then lets the stick go by itself.

import { isReplay } from "./inhibits.js";
import { hand, hasKey, post } from "./requests.js";
import { DRIVE_TEXTS, MODE_BARS, MODE_TEXTS, WHEEL_TEXTS, byId, fixed, make, sentence, setText } from "./text.js";
import { isTyping } from "./time.js";
import { describeWheel } from "./wheel.js";

const SAY_MS = 80; // the operator's process lets a stick go that it has not heard of for 300 ms
const DEAD_ZONE = 0.15; // of a gamepad's stick, which rests nowhere exactly
const MAX_UNDER_WAY = 3; // set-points on a slow link; more would only come late
const SETPOINT_MS = 2000; // one that nobody answers for so long is given up, so that a hand drives again when the link is back
/** What a key asks for: surge ahead, turn to port. @type {Record<string, [number, number]>} */
const KEYS = {
  KeyW: [1, 0], ArrowUp: [1, 0], KeyS: [-1, 0], ArrowDown: [-1, 0],
  KeyA: [0, 1], ArrowLeft: [0, 1], KeyD: [0, -1], ArrowRight: [0, -1],
};
let number = Date.now(), underWay = 0, refusal = "", canDrive = false;
/** Whether what was said last drives nowhere. */
let isNeutral = true;
/** Keys that are held. @type {Set<string>} */
const held = new Set();
/** Where the stick is held: ahead and to port, each in [-1, 1]; null while it is not. @type {[number, number] | null} */
let stick = null;
/** The pointer that holds the stick: no other finger moves it or lets it go. */
let pointer = 0;
/** Whether the gamepad was in neutral since it was last let go: one that is held from before drives nothing. */
let isPadFree = false;

/** Whether this page drives by hand now, so that its keys steer. */
export const isDriving = () => canDrive;

/** What the left stick of a gamepad asks for; nothing while the page has not the focus. @returns {[number, number]} */
function readPad() {
  const pad = document.hasFocus() ? navigator.getGamepads().find((each) => each?.connected) : undefined;
  const part = (/** @type {number} */ axis) => (Math.abs(axis) < DEAD_ZONE ? 0 : Math.round(Math.max(-1, Math.min(1, -axis)) * 20) / 20);
  const [surge, turn] = pad ? [part(pad.axes[1] ?? 0), part(pad.axes[0] ?? 0)] : [0, 0];
  if (pad && surge === 0 && turn === 0) isPadFree = true;
  return pad && isPadFree ? [surge, turn] : [0, 0];
}

/** What the hand asks for now: ahead and to port. @returns {[number, number]} */
function wanted() {
  if (stick) return stick;
  if (!held.size) return readPad();
  const sum = (/** @type {number} */ axis) => [...held].reduce((all, code) => all + KEYS[code][axis], 0);
  return [Math.max(-1, Math.min(1, sum(0))), Math.max(-1, Math.min(1, sum(1)))];
}

/** What the hand asks for now; a stick that was just let go is said at once, whatever is under way. @param {boolean} [isLast] */
async function say(isLast = false) {
  const [surge, turn] = wanted();
  const isLetGo = !isNeutral && surge === 0 && turn === 0;
  if (!canDrive || (underWay >= MAX_UNDER_WAY && !isLetGo)) return;
  isNeutral = surge === 0 && turn === 0;
  underWay++;
  number = Math.max(number + 1, Date.now());
  const refused = await post("/api/drive/setpoint", { hand, number, surge, turn }, isLast, SETPOINT_MS);
  underWay--;
  if (refused) letGo();
  if (refused) refusal = refused;
}

/** The stick and every key are let go, which is said at once. @param {boolean} [isLast] */
function letGo(isLast = false) {
  const wasHeld = stick !== null || held.size > 0 || isPadFree;
  stick = null;
  isPadFree = false;
  held.clear();
  renderStick();
  if (wasHeld) void say(isLast);
}

/** @param {string} what @param {object} [more] */
async function ask(what, more = {}) {
  if (!hasKey()) return;
  refusal = await post(`/api/drive/${what}`, { hand, ...more });
}

/** @param {PointerEvent} event */
function moveStick(event) {
  const box = byId("stick").getBoundingClientRect(), half = box.width / 2;
  const part = (/** @type {number} */ value) => Math.round(Math.max(-1, Math.min(1, value / half)) * 20) / 20;
  stick = [part(box.top + half - event.clientY), part(box.left + half - event.clientX)];
  renderStick();
}

function renderStick() {
  const [surge, turn] = wanted(), scale = 35 / Math.max(1, Math.hypot(surge, turn)); // a corner is drawn on the rim
  byId("stick-knob").setAttribute("cx", String(50 - scale * turn));
  byId("stick-knob").setAttribute("cy", String(50 - scale * surge));
  byId("stick").dataset.held = String(surge !== 0 || turn !== 0);
  setText(byId("drive-asks"), askedText(surge, turn));
}

/** What a hand asks for, in words. @param {number} surge ahead @param {number} turn to port */
function askedText(surge, turn) {
  const part = (/** @type {number} */ value, /** @type {string} */ more, /** @type {string} */ less) => value && `${value > 0 ? more : less} ${fixed(Math.abs(value) * 100, 0)} %`;
  const parts = [part(surge, DRIVE_TEXTS.ahead, DRIVE_TEXTS.astern), part(turn, DRIVE_TEXTS.port, DRIVE_TEXTS.starboard)].filter(Boolean);
  return parts.length ? sentence(parts.join(", ")) : DRIVE_TEXTS.letGo;
}

function bindStick() {
  const pad = byId("stick");
  pad.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    if (!canDrive || stick) return;
    pointer = event.pointerId;
    pad.setPointerCapture(pointer);
    moveStick(event);
    void say();
  });
  pad.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => stick && event.pointerId === pointer && moveStick(event));
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
    pad.addEventListener(name, (/** @type {PointerEvent} */ event) => event.pointerId === pointer && letGo());
  }
  pad.addEventListener("contextmenu", (/** @type {Event} */ event) => event.preventDefault());
}

function bindKeys() {
  addEventListener("keydown", (event) => {
    if (!canDrive || !(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    event.preventDefault();
    if (event.repeat) return; // a key that was held before the wheel was, or while the link was lost, is pressed anew
    held.add(event.code);
    renderStick();
    void say();
  });
  addEventListener("keyup", (event) => {
    if (!held.delete(event.code)) return;
    renderStick();
    void say();
  });
}

/** On a phone, picture and stick take the screen while its page drives by hand; after a frame it is laid out for them. */
const showWhatOneDrivesBy = () => requestAnimationFrame(() => requestAnimationFrame(() => byId("panels").scrollIntoView()));

export function bindDrive() {
  for (const mode of Object.keys(MODE_TEXTS)) {
    const button = make("button");
    Object.assign(button, { type: "button", disabled: true }); // until it is known what may be ordered
    button.dataset.drive = mode;
    button.append(make("b", "", MODE_TEXTS[mode][0]), make("span", "", MODE_TEXTS[mode][1]));
    button.addEventListener("click", () => {
      button.blur();
      void ask("mode", { mode });
    });
    byId("drive-modes").append(button);
  }
  byId("drive-take").addEventListener("click", () => void ask("wheel"));
  byId("drive-override").addEventListener("click", () => {
    byId("drive-override").blur();
    void ask("override");
  });
  bindStick();
  bindKeys();
  addEventListener("blur", () => letGo());
  matchMedia("(orientation: portrait)").addEventListener("change", () => canDrive && showWhatOneDrivesBy());
  addEventListener("pagehide", () => letGo(true));
  document.addEventListener("visibilitychange", () => document.hidden && letGo(true));
  setInterval(() => !document.hidden && void say(), SAY_MS);
}

/** @param {import("./store.js").Store} store @param {boolean} open @param {number} now @param {boolean} isAway whether the page shows the past or another tab, from where nobody drives */
export function renderDrive(store, open, now, isAway) {
  byId("drive").hidden = isReplay(store) || isAway;
  const operator = open && store.isFresh("operator/state", now) ? store.get("operator/state") : undefined;
  const { isHolder, isFree, name } = describeWheel(operator), isManual = operator?.mode === "MANUAL";
  const mayDrive = isManual && isHolder && !isAway;
  if (canDrive && !mayDrive) letGo();
  canDrive = mayDrive;
  if (!canDrive) isPadFree = false;
  else renderStick();
  const { dataset } = byId("drive"), begins = canDrive && dataset.driving !== "true";
  dataset.driving = String(canDrive);
  setText(byId("drive-wheel"), operator ? `${name} ${WHEEL_TEXTS.holds}` : WHEEL_TEXTS.silent);
  byId("drive-take").hidden = !operator || isHolder || isFree;
  /** Names of the modes that may not start, by the reason. @type {Map<string, string[]>} */
  const barred = new Map();
  for (const button of /** @type {NodeListOf<HTMLButtonElement>} */ (document.querySelectorAll("[data-drive]"))) {
    const mode = String(button.dataset.drive), bar = operator?.barred.find((/** @type {any} */ each) => each.mode === mode)?.refusal;
    const reason = !operator ? "unknown" : !isHolder && !isFree ? MODE_BARS.NOT_HOLDER : bar ? MODE_BARS[bar] : "";
    button.disabled = Boolean(reason);
    if (reason) barred.set(reason, [...(barred.get(reason) ?? []), MODE_TEXTS[mode][0]]);
    button.setAttribute("aria-pressed", String(operator?.mode === mode));
    setText(button.querySelector("span"), reason || MODE_TEXTS[mode][1]);
  }
  setText(byId("drive-bars"), [...barred].map(([reason, names]) => `${names.join(", ")}: ${reason}`).join(" · "));
  byId("drive-hand").hidden = !canDrive;
  if (begins) showWhatOneDrivesBy();
  const leftS = operator ? operator.override_ms / 1000 : 0;
  setText(byId("drive-override"), leftS > 0 ? DRIVE_TEXTS.overridden(fixed(leftS, 0)) : DRIVE_TEXTS.override);
  byId("drive-override").dataset.on = String(leftS > 0);
  const vetoes = canDrive && store.isFresh("navigator/command", now) ? (store.get("navigator/command").vetoes ?? []) : [];
  setText(byId("drive-note"), refusal || (vetoes.length ? DRIVE_TEXTS.vetoed : ""));
}
