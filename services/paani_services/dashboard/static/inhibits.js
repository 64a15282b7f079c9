// @ts-check
// Every reason why the boat does not move, in order from the picture to the thrust gate. Pure.

import { INHIBIT_TEXTS, STAGES, STOP_REASONS, reasonText, words } from "./text.js";

/** @typedef {{stage: string, code: string, text: string}} StopReason */

/** Whether arming ends this reason. @param {StopReason} reason */
export const isOfArming = ({ code }) => code === "NOT_ARMED" || code === "not_armed";

/** The topic of each stage that sends one. @type {[string, string][]} */
const TOPICS = [
  ["camera", "camera/picture"], ["perception", "perception/evidence"], ["advisor", "advisor/advisory"],
  ["localization", "localization/odometry"], ["operator", "operator/state"], ["navigator", "navigator/command"],
  ["controller", "controller/thrust"], ["gate", "plant/thrust_applied"],
];
/** The stage that an inhibit speaks of; the navigator and the controller only pass it on. @type {Record<string, string>} */
const STAGE_OF_INHIBIT = {
  NO_ADVISORY: "advisor", STALE_ADVISORY: "advisor", ADVISED_STOP: "advisor", ADVISED_NO_DATA: "advisor", BLOCKED_AHEAD: "advisor",
  NO_ODOMETRY: "localization", STALE_ODOMETRY: "localization", UNHEALTHY_ODOMETRY: "localization", MAP_MOVED: "localization",
  NOT_ARMED: "operator", NO_ORDER: "operator", STALE_ORDER: "operator", IDLE: "operator", NEUTRAL: "operator",
  NO_ROUTE: "mission", ROUTE_FINISHED: "mission", HOLDING: "mission", MISSION_DONE: "mission",
  NO_FREE_PATH: "planner", TURN_CAPPED: "planner", OUTSIDE_FENCE: "fence",
  NO_CLOCK: "navigator", CLOCK_STOPPED: "navigator",
  NO_COMMAND: "controller", STALE_COMMAND: "controller", COMMAND_INVALID: "controller",
};

/** @param {import("./store.js").Store} store */
export const isReplay = (store) => store.get("dashboard/settings")?.mode === "replay";

/** Whether the thrust adapter says that it applies the thrust it was sent. @param {import("./store.js").Store} store @param {number} now */
export const isThrustApplied = (store, now) =>
  store.isFresh("plant/thrust_applied", now) && store.get("plant/thrust_applied").zero_cause === "none";

/**
 * Reasons in the order of the stages; each once, however many processes pass it on. None while thrust is applied, but
 * for what stops a boat whose thrust keeps its station.
 * In a replay, what is silent is no reason: orders are not played again.
 * @param {import("./store.js").Store} store @param {number} now @returns {StopReason[]}
 */
export function findInhibits(store, now) {
  const order = fresh(store, "navigator/command", now), isApplied = isThrustApplied(store, now);
  if (isApplied && !order?.keeps_station) return [];
  /** @type {StopReason[]} */
  const found = [];
  const add = (/** @type {string} */ stage, /** @type {string} */ code, /** @type {string} */ text) => {
    if (!found.some((reason) => reason.stage === stage && reason.code === code)) found.push({ stage, code, text });
  };
  for (const [stage, key] of TOPICS) {
    if (!store.isFresh(key, now) && !isReplay(store)) add(stage, "SILENT", STAGES[stage][1]);
  }
  const evidence = fresh(store, "perception/evidence", now), operator = fresh(store, "operator/state", now);
  if (evidence && !evidence.usable) add("perception", "UNUSABLE", `${INHIBIT_TEXTS.unusable}: ${words(evidence.cause)}`);
  if (operator?.stopped) add("operator", "NOT_ARMED", INHIBIT_TEXTS.stopHolds);
  for (const [stage, key] of TOPICS) {
    for (const inhibit of fresh(store, key, now)?.inhibits ?? []) add(STAGE_OF_INHIBIT[inhibit] ?? stage, inhibit, inhibitText(store, inhibit));
  }
  for (const veto of order?.keeps_station ? order.vetoes : []) add(STAGE_OF_INHIBIT[veto] ?? "navigator", veto, inhibitText(store, veto));
  const applied = fresh(store, "plant/thrust_applied", now);
  if (applied && !isApplied) add("gate", applied.zero_cause, gateText(store, applied, now));
  const stages = Object.keys(STAGES);
  return found.sort((a, b) => stages.indexOf(a.stage) - stages.indexOf(b.stage));
}

/** @param {import("./store.js").Store} store @param {string} key @param {number} now */
const fresh = (store, key, now) => (store.isFresh(key, now) ? store.get(key) : undefined);

/** The advice's reason goes with its own inhibit alone: newer advice may be another already. @param {import("./store.js").Store} store @param {string} inhibit */
function inhibitText(store, inhibit) {
  const advisory = store.get("advisor/advisory"), text = STOP_REASONS[inhibit] ?? words(inhibit);
  return inhibit === `ADVISED_${advisory?.direction}` ? `${text}: ${reasonText(advisory.reason).toLowerCase()}` : text;
}

/** @param {import("./store.js").Store} store @param {any} applied @param {number} now */
function gateText(store, applied, now) {
  const detail = applied.lost_pulse || fresh(store, "thrusters/state", now)?.problem;
  return (STOP_REASONS[applied.zero_cause] ?? words(applied.zero_cause)) + (detail ? `: ${detail}` : "");
}
