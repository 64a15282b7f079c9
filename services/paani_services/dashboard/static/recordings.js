// @ts-check
// The recordings tab: list, download, protect, delete, and playing one here.

import { ask, recordingSource } from "./past_source.js";
import { hasKey, post } from "./requests.js";
import { showTab } from "./tabs.js";
import { RECORDING_TEXTS, byId, make, setText, spanText } from "./text.js";
import { sizeText } from "./topics.js";

const SURE_MS = 4000; // a second press on Delete within this time deletes

/** @typedef {{name: string, size_bytes: number, start_us: number, duration_s: number | null, protected: boolean, running: boolean}} Recording */

/** @param {import("./time.js").Time} time */
export function bindRecordings(time) {
  byId("recordings-again").addEventListener("click", () => void list(time));
  document.querySelector('[data-tab-of="recordings"]')?.addEventListener("click", () => void list(time));
}

/** @param {import("./time.js").Time} time @param {string} [note] */
async function list(time, note = "") {
  say(note || RECORDING_TEXTS.reading, false);
  try {
    const { folder, recordings, left_out: leftOut } = await (await ask("/api/recordings")).json();
    setText(byId("recordings-sum"), !folder ? "" : `${recordings.length + leftOut} ${RECORDING_TEXTS.in} ${folder}`);
    byId("recordings").replaceChildren(...recordings.map((/** @type {Recording} */ each) => rowOf(time, each)));
    say(note || (leftOut ? `${leftOut} ${RECORDING_TEXTS.leftOut}` : recordings.length ? "" : folder ? RECORDING_TEXTS.none : RECORDING_TEXTS.off), Boolean(note));
  } catch (error) {
    byId("recordings").replaceChildren();
    setText(byId("recordings-sum"), "");
    say(String(error instanceof Error ? error.message : error), false);
  }
}

/** @param {import("./time.js").Time} time @param {Recording} recording */
function rowOf(time, recording) {
  const row = make("tr"), acts = make("td"), path = `/api/recordings/${encodeURIComponent(recording.name)}`;
  const state = recording.running ? RECORDING_TEXTS.running : recording.protected ? RECORDING_TEXTS.protected : "";
  const link = make("a", "", RECORDING_TEXTS.download);
  link.setAttribute("href", `${path}/file`);
  link.setAttribute("download", recording.name);
  acts.append(
    button(RECORDING_TEXTS.play, () => void play(time, recording.name), recording.running),
    link,
    button(recording.protected ? RECORDING_TEXTS.unprotect : RECORDING_TEXTS.protect, () => void act(time, "protect", { name: recording.name, protected: !recording.protected })),
    deleteButton(time, recording),
  );
  row.dataset.name = recording.name;
  row.append(
    make("td", "", recording.name), make("td", "", new Date(recording.start_us / 1000).toLocaleString()),
    make("td", "number", recording.duration_s === null ? "–" : spanText(recording.duration_s * 1e6)),
    make("td", "number", sizeText(recording.size_bytes)), make("td", recording.running ? "warn" : "quiet", state), acts,
  );
  return row;
}

/** @param {import("./time.js").Time} time @param {Recording} recording */
function deleteButton(time, recording) {
  let askedAt = -SURE_MS;
  const found = button(RECORDING_TEXTS.delete, () => {
    if (performance.now() - askedAt < SURE_MS) void act(time, "delete", { name: recording.name });
    askedAt = performance.now();
    setText(found, RECORDING_TEXTS.sure);
    setTimeout(() => setText(found, RECORDING_TEXTS.delete), SURE_MS);
  }, recording.protected || recording.running);
  return found;
}

/** @param {string} text @param {() => void} onPress @param {boolean} [isOff] */
function button(text, onPress, isOff = false) {
  const found = make("button", "", text);
  Object.assign(found, { type: "button", disabled: isOff });
  found.addEventListener("click", onPress);
  return found;
}

/** @param {import("./time.js").Time} time @param {string} what @param {object} body */
async function act(time, what, body) {
  if (hasKey()) await list(time, await post(`/api/recordings/${what}`, body));
}

/** @param {import("./time.js").Time} time @param {string} name */
async function play(time, name) {
  say(RECORDING_TEXTS.reading, false);
  try {
    const source = await recordingSource(name);
    showTab("drive");
    time.open(source, source.series.startUs);
    time.playback.playing = true;
    say("", false);
  } catch (error) {
    say(String(error instanceof Error ? error.message : error), true);
  }
}

/** @param {string} text @param {boolean} isBad */
function say(text, isBad) {
  setText(byId("recordings-note"), text);
  byId("recordings-note").dataset.bad = String(isBad);
}
