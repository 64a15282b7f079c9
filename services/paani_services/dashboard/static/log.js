// @ts-check
// The newest lines first: what the server tells, and each change of advice.

import { byId, make, reasonText } from "./text.js";

const KEPT = 60;
let advice = "";

/** @param {{at_us: number, level: string, text: string}} event */
export function addLine(event) {
  const line = make("li"), at = make("time", "", new Date(event.at_us / 1000).toTimeString().slice(0, 8));
  line.dataset.level = event.level;
  line.append(at, make("span", "", event.text));
  const list = byId("log");
  list.prepend(line);
  while (list.children.length > KEPT) list.lastChild.remove();
}

/** @param {any} advisory */
export function noteAdvice(advisory) {
  const now = `${advisory.direction} ${advisory.reason}`;
  if (now === advice) return;
  advice = now;
  const level = advisory.direction === "STOP" || advisory.direction === "NO_DATA" ? "stop" : "info";
  addLine({ at_us: advisory.sent_us, level, text: `${advisory.direction.replaceAll("_", " ")}: ${reasonText(advisory.reason)}` });
}
