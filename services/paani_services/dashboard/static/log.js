// @ts-check
// The log panel, newest line first: events of the dashboard, and each change of advice; repeats are counted.

import { byId, clockText, make, reasonText, setText } from "./text.js";

const MAX_LINES = 60;
const REPEATED_WITHIN_US = 30e6, LOOK_BACK = 4; // a line that comes again so soon, among so many, is counted, not added
let lastAdvice = "";

/** @param {{at_us: number, level: string, text: string}} event */
export function addLine(event) {
  const list = byId("log"), before = [...list.children].slice(0, LOOK_BACK).find((/** @type {any} */ line) => isRepeat(line, event));
  if (before) {
    before.dataset.count = String(Number(before.dataset.count) + 1);
    before.dataset.at = String(event.at_us);
    setText(before.lastChild, `${event.text} (× ${before.dataset.count})`);
    return;
  }
  list.prepend(lineOf(event));
  while (list.children.length > MAX_LINES) list.lastChild.remove();
}

/** Show the events of a drive of the past instead; null: the log again. @param {{at_us: number, level: string, text: string}[] | null} events */
export function showLogOf(events) {
  const list = byId("log-past"), key = events ? `${events.length} ${events.at(-1)?.at_us}` : "";
  byId("log").hidden = Boolean(events);
  list.hidden = !events;
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...(events ?? []).slice(-MAX_LINES).reverse().map(lineOf));
}

/** @param {{at_us: number, level: string, text: string}} event */
function lineOf(event) {
  const line = make("li");
  Object.assign(line.dataset, { level: event.level, text: event.text, count: "1", at: String(event.at_us) });
  line.append(make("time", "", clockText(event.at_us)), make("span", "", event.text));
  return line;
}

/** @param {HTMLElement} line @param {{at_us: number, text: string}} event */
const isRepeat = (line, event) => line.dataset.text === event.text && Math.abs(event.at_us - Number(line.dataset.at)) <= REPEATED_WITHIN_US;

/** @param {any} advisory */
export function logAdvice(advisory) {
  const now = `${advisory.direction} ${advisory.reason}`;
  if (now === lastAdvice) return;
  lastAdvice = now;
  const level = advisory.direction === "STOP" || advisory.direction === "NO_DATA" ? "stop" : "info";
  addLine({ at_us: advisory.sent_us, level, text: `${advisory.direction.replaceAll("_", " ")}: ${reasonText(advisory.reason)}` });
}
