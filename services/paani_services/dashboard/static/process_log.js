// @ts-check
// The last lines of a process's log, in the health tab.

import { ask } from "./past_source.js";
import { HEALTH_TEXTS, byId, setText } from "./text.js";

let shown = "";

/** @param {string} name */
async function show(name) {
  shown = name;
  byId("process-log").hidden = false;
  setText(byId("process-log-title"), `${HEALTH_TEXTS.log} ${name}`);
  let text = "", note = "";
  try {
    const { lines, cut } = await (await ask(`/api/logs/${encodeURIComponent(name)}`)).json();
    text = lines.join("\n");
    note = !lines.length ? HEALTH_TEXTS.empty : cut ? HEALTH_TEXTS.cut : "";
  } catch (error) {
    note = String(error instanceof Error ? error.message : error);
  }
  if (shown !== name) return;
  setText(byId("process-log-note"), note);
  setText(byId("process-log-text"), text);
  const pre = byId("process-log");
  pre.scrollTop = pre.scrollHeight;
}

/** @param {HTMLElement} button @param {string} name */
export function bindProcessLog(button, name) {
  button.addEventListener("click", () => void show(name));
  byId("process-log-again").onclick = () => void show(shown);
}
