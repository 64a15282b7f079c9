// @ts-check
// The recordings tab: list, download, protect, delete, and playing one here.

import { ask, recordingSource } from "./past_source.js";
import { hasKey, post } from "./requests.js";
import { shownTab, showTab } from "./tabs.js";
import { effect, html, mount, signal, tableHead } from "./templates.js";
import { RECORDING_TEXTS, spanText } from "./text.js";
import { sizeText } from "./topics.js";

const SURE_MS = 4000; // a second press on Delete within this time deletes
const NOTHING = { folder: "", recordings: /** @type {Recording[]} */ ([]), left_out: 0 };

/** @typedef {{name: string, size_bytes: number, start_us: number, duration_s: number | null, protected: boolean, running: boolean}} Recording */

const listed = signal(NOTHING), note = signal({ text: "", isBad: false });
const asked = signal(""); // the recording whose Delete was pressed once

/** @param {import("./time.js").Time} time */
export function bindRecordings(time) {
  effect(() => { if (shownTab.value === "recordings") void list(); });
  mount("[data-tab-panel=recordings]", () => view(time));
}

/** @param {string} [told] of what was asked before */
async function list(told = "") {
  say(told || RECORDING_TEXTS.reading);
  try {
    const found = await (await ask("/api/recordings")).json();
    listed.value = found;
    say(told || (found.left_out ? `${found.left_out} ${RECORDING_TEXTS.leftOut}` : found.recordings.length ? "" : found.folder ? RECORDING_TEXTS.none : RECORDING_TEXTS.off), Boolean(told));
  } catch (error) {
    listed.value = NOTHING;
    say(messageOf(error));
  }
}

/** @param {import("./time.js").Time} time */
function view(time) {
  const { folder, recordings, left_out: leftOut } = listed.value;
  return html`<div class="panel" tabindex="0" role="group" aria-label=${RECORDING_TEXTS.list}>
    <header><h2>${RECORDING_TEXTS.title}</h2><span id="recordings-sum" class="quiet">${folder && `${recordings.length + leftOut} ${RECORDING_TEXTS.in} ${folder}`}</span><button id="recordings-again" type="button" onClick=${() => void list()}>${RECORDING_TEXTS.again}</button></header>
    <p id="recordings-note" class="tab-note quiet" role="status" data-bad=${note.value.isBad}>${note.value.text}</p>
    ${recordings.length > 0 && html`<table>${tableHead(RECORDING_TEXTS.columns, [2, 3])}<tbody id="recordings">${recordings.map((each) => row(time, each))}</tbody></table>`}
  </div>`;
}

/** @param {import("./time.js").Time} time @param {Recording} recording */
function row(time, { name, start_us: startUs, duration_s: durationS, size_bytes: bytes, running, protected: isProtected }) {
  const state = running ? RECORDING_TEXTS.running : isProtected ? RECORDING_TEXTS.protected : "";
  return html`<tr key=${name} data-name=${name}>
    <td>${name}</td><td>${new Date(startUs / 1000).toLocaleString()}</td><td class="number">${durationS === null ? "–" : spanText(durationS * 1e6)}</td><td class="number">${sizeText(bytes)}</td><td class=${running ? "warn" : "quiet"}>${state}</td>
    <td><button type="button" disabled=${running} onClick=${() => void play(time, name)}>${RECORDING_TEXTS.play}</button>
      <a href="/api/recordings/${encodeURIComponent(name)}/file" download=${name}>${RECORDING_TEXTS.download}</a>
      <button type="button" onClick=${() => void act("protect", { name, protected: !isProtected })}>${isProtected ? RECORDING_TEXTS.unprotect : RECORDING_TEXTS.protect}</button>
      <button type="button" disabled=${isProtected || running} onClick=${() => erase(name)}>${asked.value === name ? RECORDING_TEXTS.sure : RECORDING_TEXTS.delete}</button></td></tr>`;
}

/** At the second press. @param {string} name */
function erase(name) {
  if (asked.value === name) void act("delete", { name });
  asked.value = asked.value === name ? "" : name;
  setTimeout(() => { if (asked.value === name) asked.value = ""; }, SURE_MS);
}

/** @param {string} what @param {object} body */
async function act(what, body) {
  if (hasKey()) await list(await post(`/api/recordings/${what}`, body));
}

/** @param {import("./time.js").Time} time @param {string} name */
async function play(time, name) {
  say(RECORDING_TEXTS.reading);
  try {
    const source = await recordingSource(name);
    showTab("drive");
    time.open(source, source.series.startUs);
    time.playback.playing = true;
    say("");
  } catch (error) {
    say(messageOf(error), true);
  }
}

/** @param {string} text @param {boolean} [isBad] */
function say(text, isBad = false) {
  note.value = { text, isBad };
}

/** @param {unknown} error */
export const messageOf = (error) => String(error instanceof Error ? error.message : error);
