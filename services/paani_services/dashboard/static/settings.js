// @ts-check
// The settings tab: every setting with its default, range and where it comes from; and the tuning step, with what the
// shadow policy would have advised.

import { ask } from "./past_source.js";
import { messageOf } from "./recordings.js";
import { hasKey, post } from "./requests.js";
import { shownTab } from "./tabs.js";
import { cell, computed, effect, html, mount, present, signal, tableHead } from "./templates.js";
import { SETTING_TEXTS } from "./text.js";
import { changesText, countsText } from "./tuning.js";

/** @typedef {{path: string, value: string, default: string, origin: string, unit: string, limits: string, tunable: boolean}} Setting */

/** @type {{value: Setting[]}} */
const settings = signal([]);
const search = signal(""), isChangedOnly = signal(false), note = signal("");
/** What is tried and what is in force of late; undefined: unknown. */
const shadow = computed(() => {
  const { store, now } = present.value;
  return store.isFresh("advisor/shadow", now) ? store.get("advisor/shadow") : undefined;
});
/** As text, so that the rows are drawn again only where a value is tuned. */
const changes = computed(() => JSON.stringify(shadow.value?.active_changes ?? []));
/** Whether somebody looks for each. */
const found = computed(() => {
  const text = search.value.trim().toLowerCase(), tuned = tunedValues();
  return settings.value.map(({ path, origin }) => path.includes(text) && (!isChangedOnly.value || tuned.has(path) || origin !== "default"));
});
const rows = computed(() => {
  const tuned = tunedValues();
  return settings.value.map((setting, index) => row(setting, tuned.get(setting.path), found.value[index]));
});

/** @returns {Map<string, string>} */
const tunedValues = () => new Map(JSON.parse(changes.value).map((/** @type {any} */ change) => [change.path, change.value]));

export function bindSettings() {
  effect(() => { if (shownTab.value === "settings") void load(); });
  mount("[data-tab-panel=settings]", view);
}

/** Once: they stay as they are while the boat runs. */
async function load() {
  if (settings.value.length) return;
  try {
    settings.value = await (await ask("/api/settings")).json();
  } catch (error) {
    note.value = messageOf(error);
  }
}

function view() {
  const proposal = shadow.value?.proposal ?? "", active = shadow.value?.active ?? "";
  return html`<div class="panel" tabindex="0" role="group" aria-label=${SETTING_TEXTS.table}>
    <header><h2>${SETTING_TEXTS.title}</h2><span id="settings-sum" class="quiet">${found.value.filter(Boolean).length} ${SETTING_TEXTS.of} ${found.value.length}</span>
      <input id="settings-search" type="search" placeholder=${SETTING_TEXTS.search} aria-label=${SETTING_TEXTS.searchLabel} onInput=${(/** @type {any} */ event) => { search.value = event.target.value; }} />
      <button id="settings-changed" type="button" aria-pressed=${isChangedOnly.value} onClick=${() => { isChangedOnly.value = !isChangedOnly.value; }}>${SETTING_TEXTS.changedOnly}</button>
      <button id="settings-promote" type="button" disabled=${!proposal} onClick=${() => void act("promote", { proposal })}>${SETTING_TEXTS.promote}</button>
      <button id="settings-rollback" type="button" disabled=${!proposal && !active} onClick=${() => void act("rollback", { proposal: proposal || active })}>${SETTING_TEXTS.rollback}</button></header>
    <p id="settings-note" class="tab-note" role="status" data-bad=${note.value !== ""}>${note.value}</p>
    <p id="settings-trial" class="tab-note quiet">${proposal ? `${proposal} ${SETTING_TEXTS.sent}: ${changesText(shadow.value.changes)}. ${countsText(shadow.value)}` : SETTING_TEXTS.none}</p>
    <table class="cards">${tableHead(SETTING_TEXTS.columns)}<tbody id="settings">${rows.value}</tbody></table>
  </div>`;
}

/** A row that nobody looks for is hidden, so that what was typed into its field stays. @param {Setting} setting @param {string | undefined} tuned @param {boolean} isFound */
function row({ path, value, unit, default: usual, limits, origin, tunable }, tuned, isFound) {
  const isChanged = tuned !== undefined || origin !== "default", orDash = (/** @type {string} */ text) => (text === "-" ? "–" : text);
  const propose = (/** @type {any} */ event) => {
    event.preventDefault();
    void act("propose", { changes: [{ path, value: event.target.elements[0].value.trim() }] });
  };
  const [, ofValue, ofUnit, ofDefault, ofRange, ofOrigin, ofTrial] = SETTING_TEXTS.columns;
  return html`<tr key=${path} hidden=${!isFound}>
    <td>${path}</td>${cell(ofValue, orDash(tuned ?? value), "wide")}${cell(ofUnit, orDash(unit))}${cell(ofDefault, orDash(usual), "wide")}${cell(ofRange, orDash(limits), "quiet")}${cell(ofOrigin, tuned === undefined ? origin : SETTING_TEXTS.tuned, isChanged ? "warn" : "quiet")}
    <td data-column=${tunable ? ofTrial : ""}>${tunable && html`<form onSubmit=${propose}><input size="7" defaultValue=${value} aria-label="${SETTING_TEXTS.try} ${path}" /> <button>${SETTING_TEXTS.try}</button></form>`}</td></tr>`;
}

/** @param {string} what @param {object} body */
async function act(what, body) {
  if (hasKey()) note.value = await post(`/api/tune/${what}`, body);
}
