// @ts-check
// The log panel, newest line first: events of the dashboard, and each change of advice; repeats are counted.

import { html, mount, signal } from "./templates.js";
import { LOG_TEXTS, clockText, noteText, reasonText } from "./text.js";

const MAX_LINES = 60;
const REPEATED_WITHIN_US = 30e6, LOOK_BACK = 4; // a line that comes again so soon, among so many, is counted, not added

/** @typedef {{at_us: number, level: string, text: string}} Event */
/** @typedef {Event & {key: number, firstUs: number, count: number}} Line an event and when it came again last */

/** @type {{value: Line[]}} */
const lines = signal([]);
/** Of a drive of the past, which are shown instead. @type {{value: Event[] | null}} */
const past = signal(null);
let lastAdvice = "", added = 0;

export function bindLog() {
  mount(".log", () => html`<header><h2>${LOG_TEXTS.title}</h2></header>
    <ol id="log" tabindex="0" aria-label=${LOG_TEXTS.label} hidden=${past.value !== null}>${lines.value.map((line) => item(line, line.firstUs, line.key, line.count))}</ol>
    <ol id="log-past" tabindex="0" aria-label=${LOG_TEXTS.past} hidden=${past.value === null}>${past.value?.slice(-MAX_LINES).reverse().map((event) => item({ ...event, text: noteText(event.text) }, event.at_us))}</ol>`);
}

/** @param {Event} event @param {number} atUs @param {number} [key] @param {number} [count] */
const item = ({ level, text }, atUs, key, count = 1) => html`<li key=${key} data-level=${level}><time>${clockText(atUs)}</time><span>${count > 1 ? `${text} (× ${count})` : text}</span></li>`;

/** @param {Event} event */
export function addLine(event) {
  const before = lines.value.slice(0, LOOK_BACK).find((line) => line.text === event.text && Math.abs(event.at_us - line.at_us) <= REPEATED_WITHIN_US);
  lines.value = before
    ? lines.value.map((line) => (line === before ? { ...line, at_us: event.at_us, count: line.count + 1 } : line))
    : [{ ...event, key: added++, firstUs: event.at_us, count: 1 }, ...lines.value].slice(0, MAX_LINES);
}

export function clearLog() {
  lines.value = [];
}

/** Show the events of a drive of the past instead; null: the log again. @param {Event[] | null} events */
export function showLogOf(events) {
  if (events?.length !== past.value?.length || events?.at(-1) !== past.value?.at(-1)) past.value = events;
}

/** @param {any} advisory */
export function logAdvice(advisory) {
  const now = `${advisory.direction} ${advisory.reason}`;
  if (now === lastAdvice) return;
  lastAdvice = now;
  const level = advisory.direction === "STOP" || advisory.direction === "NO_DATA" ? "stop" : "info";
  addLine({ at_us: advisory.sent_us, level, text: `${advisory.direction.replaceAll("_", " ")}: ${reasonText(advisory.reason)}` });
}
