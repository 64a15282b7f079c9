// @ts-check
// The log panel, newest line first: events of the dashboard, and each change of advice; repeats are counted.

import { byId, make, reasonText, setText } from "./text.js";

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
  const line = make("li"), at = make("time", "", new Date(event.at_us / 1000).toTimeString().slice(0, 8));
  Object.assign(line.dataset, { level: event.level, text: event.text, count: "1", at: String(event.at_us) });
  line.append(at, make("span", "", event.text));
  list.prepend(line);
  while (list.children.length > MAX_LINES) list.lastChild.remove();
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
