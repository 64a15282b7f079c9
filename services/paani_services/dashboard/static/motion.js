// @ts-check
// The motion panel: thrust of the fans, the command in force, and every reason why the boat does not move.

import { STOP_REASONS, byId, fixed, headingDeg, make, sentence, setFacts, setText, words } from "./text.js";

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
  const reasons = findStopReasons(store, now);
  const moving = fresh && applied?.zero_cause === "none";
  setText(byId("motion-word"), moving ? "thrust applied" : fresh ? "zero thrust" : "no data from the plant");
  const lines = reasons.length ? reasons : [["plant", "nothing inhibits thrust"]];
  const items = lines.map(([who, text]) => {
    const item = make("li");
    item.append(make("span", "", sentence(who)), make("span", reasons.length ? "" : "clear", text));
    return item;
  });
  const list = byId("inhibits"), key = JSON.stringify(reasons);
  if (list.dataset.key !== key) {
    list.dataset.key = key;
    list.replaceChildren(...items);
  }
}

/** @param {import("./store.js").Store} store @param {number} now @param {any} applied */
function renderCommand(store, now, applied) {
  const command = store.get("navigator/command");
  const lagMs = applied?.command_source_us ? (applied.sent_us - applied.command_source_us) / 1000 : NaN;
  const obstacles = findPlannedObstacles(store, command?.obstacle_track_ids ?? []);
  setFacts(byId("order"), [
    ["Set speed", command ? `${fixed(command.speed_mps)} m/s` : "–", false],
    ["Set heading", command ? `${fixed(headingDeg(command.heading_rad), 0)}°` : "–", false],
    ["Cross-track", command ? `${fixed(command.cross_track_m, 1)} m` : "–", false],
    ["Command age", Number.isFinite(lagMs) ? `${fixed(lagMs, 0)} ms` : "–", false],
    ...findPower(store, now),
    ...obstacles,
  ]);
  byId("order").classList.toggle("stale", !store.isFresh("navigator/command", now));
}

/** The moving obstacles that the command was planned for, as on the picture. @param {import("./store.js").Store} store @param {number[]} ids @returns {[string, string, boolean][]} */
function findPlannedObstacles(store, ids) {
  if (!ids.length) return [];
  /** @type {{id: number, label: string}[]} */
  const tracks = store.get("advisor/tracks")?.tracks ?? [];
  const names = ids.map((id) => `${tracks.find((track) => track.id === id)?.label ?? "track"} #${id}`);
  return [["Planned for", names.join(", "), false]];
}

/** What the microcontroller of a hull's thrusters measures. @param {import("./store.js").Store} store @param {number} now @returns {[string, string, boolean][]} */
function findPower(store, now) {
  const state = store.get("thrusters/state");
  if (!state) return [];
  const known = store.isFresh("thrusters/state", now) && state.mcu !== "unknown";
  return [["Battery", known ? `${fixed(state.battery_v, 1)} V, ${fixed(state.current_a, 1)} A` : "–", false]];
}

/** Which process keeps the boat from moving, and why. @param {import("./store.js").Store} store @param {number} now @returns {[string, string][]} */
function findStopReasons(store, now) {
  /** @type {[string, string][]} */
  const reasons = [];
  const applied = store.get("plant/thrust_applied");
  if (!store.isFresh("plant/thrust_applied", now)) reasons.push(["plant", "no recent message"]);
  else if (applied.zero_cause !== "none") {
    const problem = store.isFresh("thrusters/state", now) ? store.get("thrusters/state").problem : "";
    const detail = applied.lost_pulse || problem ? `: ${applied.lost_pulse || problem}` : "";
    reasons.push([applied.producer, (STOP_REASONS[applied.zero_cause] ?? words(applied.zero_cause)) + detail]);
  }
  for (const [who, key] of [["navigator", "navigator/command"], ["controller", "controller/thrust"]]) {
    if (!store.isFresh(key, now)) reasons.push([who, "no recent message"]);
    else for (const inhibit of store.get(key).inhibits) reasons.push([who, STOP_REASONS[inhibit] ?? words(inhibit)]);
  }
  return reasons;
}
