// @ts-check
// The log panel, newest line first: events of the dashboard, and each change of advice.

import { byId, make, reasonText } from "./text.js";

const MAX_LINES = 60;
let lastAdvice = "";

/** @param {{at_us: number, level: string, text: string}} event */
export function addLine(event) {
  const line = make("li"), at = make("time", "", new Date(event.at_us / 1000).toTimeString().slice(0, 8));
  line.dataset.level = event.level;
  line.append(at, make("span", "", event.text));
  const list = byId("log");
  list.prepend(line);
  while (list.children.length > MAX_LINES) list.lastChild.remove();
}

/** @param {any} advisory */
export function logAdvice(advisory) {
  const now = `${advisory.direction} ${advisory.reason}`;
  if (now === lastAdvice) return;
  lastAdvice = now;
  const level = advisory.direction === "STOP" || advisory.direction === "NO_DATA" ? "stop" : "info";
  addLine({ at_us: advisory.sent_us, level, text: `${advisory.direction.replaceAll("_", " ")}: ${reasonText(advisory.reason)}` });
}
