// @ts-check
// The motion panel: thrust of the fans, the command in force, and every reason why the boat does not move.

import { findInhibits, isThrustApplied } from "./inhibits.js";
import { MOTION_TEXTS, STAGES, byId, fixed, headingDeg, make, sentence, setFacts, setText, trackNames } from "./text.js";

const FULL_SCALE = 0.25; // of full thrust, drawn as a full bar; the controller commands less in normal driving

/** @param {import("./store.js").Store} store @param {number} now */
export function renderMotion(store, now) {
  const applied = store.get("plant/thrust_applied"), fresh = store.isFresh("plant/thrust_applied", now);
  for (const side of ["left", "right"]) {
    const value = applied ? applied[side] : 0;
    byId(`fan-${side}`).style.width = `${Math.min(1, Math.abs(value) / FULL_SCALE) * 100}%`;
    byId(`fan-${side}`).classList.toggle("astern", value < 0);
    setText(byId(`fan-${side}-n`), applied ? `${fixed(applied[`${side}_n`], 1)} N` : "–");
  }
  document.querySelector(".fans")?.classList.toggle("stale", !fresh);
  renderCommand(store, now, applied);
  const reasons = findInhibits(store, now);
  setText(byId("motion-word"), isThrustApplied(store, now) ? MOTION_TEXTS.applied : fresh ? MOTION_TEXTS.zero : MOTION_TEXTS.silent);
  const list = byId("inhibits"), key = JSON.stringify([reasons, isThrustApplied(store, now)]);
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  byId("inhibits-title").hidden = !reasons.length;
  const items = reasons.map((reason, index) => {
    const item = make("li", index ? "" : "first");
    item.append(make("span", "", STAGES[reason.stage][0]), make("span", "", sentence(reason.text)));
    return item;
  });
  list.replaceChildren(...(items.length ? items : [make("li", "clear", isThrustApplied(store, now) ? MOTION_TEXTS.clear : "")]));
}

/** @param {import("./store.js").Store} store @param {number} now @param {any} applied */
function renderCommand(store, now, applied) {
  const command = store.get("navigator/command");
  const lagMs = applied?.command_source_us ? (applied.sent_us - applied.command_source_us) / 1000 : NaN;
  const planned = command?.obstacle_track_ids ?? [], tracks = store.get("advisor/tracks")?.tracks ?? [];
  setFacts(byId("order"), [
    [MOTION_TEXTS.setSpeed, command ? `${fixed(command.speed_mps)} m/s` : "–", false],
    [MOTION_TEXTS.setHeading, command ? `${fixed(headingDeg(command.heading_rad), 0)}°` : "–", false],
    [MOTION_TEXTS.crossTrack, command ? `${fixed(command.cross_track_m, 1)} m` : "–", false],
    [MOTION_TEXTS.age, Number.isFinite(lagMs) ? `${fixed(lagMs, 0)} ms` : "–", false],
    ...findPower(store, now),
    ...(planned.length ? [/** @type {[string, string, boolean]} */ ([MOTION_TEXTS.plannedFor, trackNames(tracks, planned), false])] : []),
  ]);
  byId("order").classList.toggle("stale", !store.isFresh("navigator/command", now));
}

/** What the microcontroller of a hull's thrusters measures. @param {import("./store.js").Store} store @param {number} now @returns {[string, string, boolean][]} */
function findPower(store, now) {
  const state = store.get("thrusters/state");
  if (!state) return [];
  const known = store.isFresh("thrusters/state", now) && state.mcu !== "unknown";
  return [[MOTION_TEXTS.battery, known ? `${fixed(state.battery_v, 1)} V, ${fixed(state.current_a, 1)} A` : "–", false]];
}
