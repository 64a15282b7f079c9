// @ts-check
// The last lines of a process's log, in the health tab.

import { ask } from "./past_source.js";
import { computed, html, signal } from "./templates.js";
import { HEALTH_TEXTS, byId } from "./text.js";

const shown = signal({ name: "", text: "", note: "" });

/** @param {string} name */
export async function showProcessLog(name) {
  shown.value = { name, text: "", note: "" };
  let text = "", note = "";
  try {
    const { lines, cut } = await (await ask(`/api/logs/${encodeURIComponent(name)}`)).json();
    text = lines.join("\n");
    note = !lines.length ? HEALTH_TEXTS.empty : cut ? HEALTH_TEXTS.cut : "";
  } catch (error) {
    note = String(error instanceof Error ? error.message : error);
  }
  if (shown.value.name !== name) return;
  shown.value = { name, text, note };
  const panel = byId("process-log");
  panel.scrollTop = panel.scrollHeight;
}

export const processLog = computed(() => {
  const { name, text, note } = shown.value;
  return html`<div id="process-log" class="panel" tabindex="0" role="group" aria-label=${HEALTH_TEXTS.logLabel} hidden=${!name}>
    <header><h2 id="process-log-title">${HEALTH_TEXTS.log} ${name}</h2><button id="process-log-again" type="button" onClick=${() => void showProcessLog(name)}>${HEALTH_TEXTS.again}</button></header>
    <p id="process-log-note" class="tab-note quiet">${note}</p><pre id="process-log-text">${text}</pre></div>`;
});
