// @ts-check
// Texts and numbers as the page shows them; the words are those of english.js. Pure.

import { NEVER, OPERATORS, REASONS, STOP_REASONS, TRACK_TEXTS } from "./english.js";

export * from "./english.js";

/** @param {string} name */
export const words = (name) => name.toLowerCase().replaceAll("_", " ");

/** @param {string} text */
export const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** A reason code as text. @param {string} reason */
export const reasonText = (reason) => sentence(REASONS[reason] ?? words(reason));

/** What a process says of itself, its codes in words. @param {string} note */
export const noteText = (note) => note.replace(/\b[A-Z]+(_[A-Z]+)*\b/g, (code) => REASONS[code] ?? STOP_REASONS[code] ?? (code.includes("_") ? words(code) : code));

/** What was dropped, and how much of it: a number, or a time where the cause names its unit. @param {{cause: string, count: number}} drop */
export const dropText = ({ cause, count }) => (cause.endsWith("_ms") ? `${words(cause.slice(0, -3))} ${count} ms` : `${words(cause)} ${count}`);

/** Tracks by number as on the picture, "person #3". @param {{id: number, label: string}[]} tracks @param {number[]} ids */
export const trackNames = (tracks, ids) => ids.map((id) => `${tracks.find((track) => track.id === id)?.label ?? TRACK_TEXTS.unnamed} #${id}`).join(", ");

/** What kind of track it is. @param {any} track */
export const trackState = (track) => (TRACK_TEXTS[track.immediate_danger ? "immediate" : track.accepted ? "accepted" : "tentative"]);

/** The label of a track, the same wherever it stands. @param {any} track */
export const trackLabel = (track) => `#${track.id} ${track.label} ${fixed(track.confidence)} ${trackState(track)}`;

/** A number with so many digits; what rounds to nothing has no sign. @param {number} value @param {number} [digits] */
export const fixed = (value, digits = 2) => (Number.isFinite(value) ? value.toFixed(digits).replace(/^-(?=[0.]+$)/, "") : "–");

/** @param {number} seconds */
export function ageText(seconds) {
  if (!Number.isFinite(seconds)) return NEVER;
  return seconds < 10 ? `${seconds.toFixed(1)} s` : seconds < 120 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
}

/** True heading in degrees from a counter-clockwise angle from east. @param {number} yawRad */
export const headingDeg = (yawRad) => (((90 - (yawRad * 180) / Math.PI) % 360) + 360) % 360;

/** @param {string} by */
export const operatorText = (by) => OPERATORS[by] ?? by;

/** The time of a moment, on this machine's clock. @param {number} us */
export const clockText = (us) => new Date(us / 1000).toTimeString().slice(0, 8);

/** A length of time as minutes and seconds. @param {number} us */
export const spanText = (us) => `${Math.floor(us / 60e6)}:${String(Math.floor((us % 60e6) / 1e6)).padStart(2, "0")}`;

/** The health report that says at which rate each topic comes. */
export const HEALTH_INPUTS = "health/dashboard";

/** Fields of every message's header, which the tab of devices leaves out. */
export const DEVICE_FACTS = { header: ["source_us", "seq", "epoch", "domain", "producer", "sent_us", "steady_us", "topic", "devices"] };

/** Set text only when it changes. @param {Element | null} element @param {string} text */
export function setText(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}

let scale = 0;

/** How much larger than on a desk's screen everything is drawn, as the page's style says; asked again where the window was resized, as each answer waits for the style of the whole page. */
export function screenScale() {
  if (!scale) addEventListener("resize", () => { scale = 0; }, { once: true });
  return (scale ||= parseFloat(getComputedStyle(document.documentElement).fontSize) / 10);
}

/** @param {string} id @returns {any} */
export const byId = (id) => document.getElementById(id);

/** @param {string} tag @param {string} [className] @param {string} [text] */
export function make(tag, className = "", text = "") {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text) element.textContent = text;
  return element;
}
