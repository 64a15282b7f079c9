// @ts-check
// The motion panel: thrust of the fans, the command in force, and every reason why the boat does not move.

import { indicatorStrip } from "./indicator.js";
import { isThrustApplied } from "./inhibits.js";
import { sensorStrip } from "./sensors.js";
import { inhibits } from "./stages.js";
import { facts, html, moment, mount } from "./templates.js";
import { MOTION_TEXTS, STAGES, fixed, headingDeg, sentence } from "./text.js";

const FULL_SCALE = 0.25; // of full thrust, drawn as a full bar; the controller commands less in normal driving

export function bindMotion() {
  mount(".motion", () => view(moment.value));
}

/** @param {import("./templates.js").Moment} moment */
function view(moment) {
  const { store, now } = moment, applied = store.get("plant/thrust_applied"), isFresh = store.isFresh("plant/thrust_applied", now), isApplied = isThrustApplied(store, now);
  const reasons = inhibits.value.map(({ stage, text }, index) => html`<li class=${index ? "" : "first"}><span>${STAGES[stage][0]}</span><span>${sentence(text)}</span></li>`);
  return html`<header><h2>${MOTION_TEXTS.title}</h2><span id="motion-word" class="quiet">${isApplied ? MOTION_TEXTS.applied : isFresh ? MOTION_TEXTS.zero : MOTION_TEXTS.silent}</span></header>
    <h3 id="inhibits-title" hidden=${!reasons.length}>${MOTION_TEXTS.inhibits}</h3>
    <ol id="inhibits" class="inhibits" aria-labelledby="inhibits-title">${reasons.length ? reasons : html`<li class="clear">${isApplied && MOTION_TEXTS.clear}</li>`}</ol>
    <div class="fans ${isFresh ? "" : "stale"}">${fan("left", applied)}${fan("right", applied)}</div>
    <dl id="order" class="facts ${store.isFresh("navigator/command", now) ? "" : "stale"}">${facts(orderOf(moment, applied))}</dl>
    ${indicatorStrip(moment)}${sensorStrip(moment)}`;
}

/** @param {"left" | "right"} side @param {any} applied */
const fan = (side, applied) => html`<div class="fan"><span>${MOTION_TEXTS[side]}</span>
  <i><b id="fan-${side}" class=${applied?.[side] < 0 ? "astern" : ""} style=${{ width: `${Math.min(1, Math.abs(applied?.[side] ?? 0) / FULL_SCALE) * 100}%` }}></b></i>
  <output id="fan-${side}-n">${applied ? `${fixed(applied[`${side}_n`], 1)} N` : "–"}</output></div>`;

/** The command in force. @param {import("./templates.js").Moment} moment @param {any} applied @returns {[string, string][]} */
function orderOf({ store, now }, applied) {
  const command = store.get("navigator/command");
  const lagMs = applied?.command_source_us ? (applied.sent_us - applied.command_source_us) / 1000 : NaN;
  return [
    [MOTION_TEXTS.setSpeed, command ? `${fixed(command.speed_mps)} m/s` : "–"],
    [MOTION_TEXTS.setHeading, command ? `${fixed(headingDeg(command.heading_rad), 0)}°` : "–"],
    [MOTION_TEXTS.crossTrack, command ? `${fixed(command.cross_track_m, 1)} m` : "–"],
    [MOTION_TEXTS.age, Number.isFinite(lagMs) ? `${fixed(lagMs, 0)} ms` : "–"],
    ...findPower(store, now),
  ];
}

/** What the microcontroller of a hull's thrusters measures. @param {import("./store.js").Store} store @param {number} now @returns {[string, string][]} */
function findPower(store, now) {
  const state = store.get("thrusters/state");
  if (!state) return [];
  const known = store.isFresh("thrusters/state", now) && state.mcu !== "unknown";
  return [[MOTION_TEXTS.battery, known ? `${fixed(state.battery_v, 1)} V, ${fixed(state.current_a, 1)} A` : "–"]];
}
