// @ts-check
// What the boat does and why, from what the processes say. Pure; the words are in text.js.

import { findInhibits, isOfArming, isReplay, isThrustApplied } from "./inhibits.js";
import { ACTIVITIES, ACTIVITY_TEXTS, STAGES, operatorText, reasonText, trackNames, words } from "./text.js";

const STANDS_STILL_MPS = 0.02; // an order this slow is to wait or to turn on the spot
/** Beginning of the leg in words (as the navigator describes it), and the activity. */
const LEGS = [["follow route", "ROUTE"], ["hold station", "STATION"], ["return home", "HOME"]];

/** @typedef {{id: string, word: string, kind: string, reason: string}} Activity */

/** @param {string} id @param {string} reason @param {string} [suffix] @returns {Activity} */
const activity = (id, reason, suffix = "") => ({ id, word: ACTIVITIES[id][0] + suffix, kind: ACTIVITIES[id][1], reason });

/**
 * The first of these that holds: stopped, thrust unknown, under way (and what for), not armed, and what keeps it still.
 * @param {import("./store.js").Store} store @param {number} now @returns {Activity}
 */
export function describeActivity(store, now) {
  const operator = store.isFresh("operator/state", now) ? store.get("operator/state") : undefined;
  const command = store.isFresh("navigator/command", now) ? store.get("navigator/command") : undefined;
  const isMoving = isThrustApplied(store, now), inhibits = findInhibits(store, now);
  if (isReplay(store) && !command) return activity("REPLAY", isMoving ? ACTIVITY_TEXTS.wasUnderWay : `${ACTIVITY_TEXTS.stoodStill}${inhibits.length ? `: ${inhibits[0].text}` : ""}`);
  if (operator?.stopped && !isMoving) return activity("STOPPED", ACTIVITY_TEXTS.stoppedBy(operatorText(operator.by)));
  if (!store.isFresh("plant/thrust_applied", now)) return activity("UNKNOWN", STAGES.gate[1]);
  if (isMoving && command?.keeps_station) return activity("KEEPING_STATION", inhibits[0].text);
  if (isMoving) return command?.enable ? describeMotion(store, command, now) : activity("UNORDERED", ACTIVITY_TEXTS.noOrder);
  if (inhibits.some(isOfArming)) return activity("NOT_ARMED", otherReason(inhibits));
  if (inhibits.some((reason) => reason.code === "IDLE")) return activity("IDLE", otherReason(inhibits.filter((reason) => reason.code !== "IDLE")));
  if (inhibits.some((reason) => reason.code === "NEUTRAL")) return activity("MANUAL", handReason(store, command, ACTIVITY_TEXTS.neutral));
  const inMission = inhibits.find((reason) => reason.stage === "mission");
  const isOnPurpose = inMission && inhibits.every((reason) => reason === inMission || reason.code === "not_enabled");
  if (isOnPurpose && inMission.code === "HOLDING") return activity("HOLDING", command?.leg || inMission.text);
  if (isOnPurpose && inMission.code !== "NO_ROUTE") return activity("DONE", inMission.text);
  return activity("NO_THRUST", (inhibits.find((reason) => reason.stage !== "mission" || reason.code === "NO_ROUTE") ?? inhibits[0]).text);
}

/** What else keeps the boat still. @param {import("./inhibits.js").StopReason[]} inhibits */
function otherReason(inhibits) {
  const other = inhibits.find((reason) => reason.code !== "NOT_ARMED" && reason.stage !== "gate");
  return other ? other.text : ACTIVITY_TEXTS.nothingElse;
}

/** Who drives by hand, and what the advice has to say in it. @param {import("./store.js").Store} store @param {any} command @param {string} what */
function handReason(store, command, what) {
  const operator = store.get("operator/state");
  const advice = operator?.override_ms > 0 ? ACTIVITY_TEXTS.overridden : command?.vetoes?.length ? ACTIVITY_TEXTS.vetoed : "";
  return [what, advice].filter(Boolean).join(", ");
}

/** What an order that moves the boat is for. @param {import("./store.js").Store} store @param {any} command @param {number} now @returns {Activity} */
function describeMotion(store, command, now) {
  const advisory = store.get("advisor/advisory"), tracks = store.get("advisor/tracks")?.tracks ?? [];
  const planned = command.obstacle_track_ids;
  if (command.leg === "manual") return activity("MANUAL", handReason(store, command, `${ACTIVITY_TEXTS.by} ${operatorText(store.get("operator/state")?.wheel_by ?? "")}`));
  if (/LEFT|RIGHT/.test(command.direction)) {
    const turn = `${ACTIVITY_TEXTS.turning} ${words(command.direction)}`;
    if (advisory?.purpose === "LOOK") return activity("LOOKING", `${turn}: ${reasonText(advisory.reason).toLowerCase()}`);
    const ids = advisory?.counterfactual?.removals[0]?.track_ids ?? [];
    const what = trackNames(tracks, ids) || reasonText(advisory?.reason ?? "").toLowerCase();
    return activity("AVOIDING", `${what}: ${turn}`, ids.length === 1 ? ` #${ids[0]}` : "");
  }
  if (command.speed_mps < STANDS_STILL_MPS) return activity("WAITING", planned.length ? `${ACTIVITY_TEXTS.waitsFor} ${trackNames(tracks, planned)}` : ACTIVITY_TEXTS.noThrust);
  const [leg, id] = LEGS.find(([begin]) => command.leg.startsWith(begin)) ?? ["", "UNDER_WAY"];
  const parts = [command.leg.slice(leg.length).replace(/^, /, "")];
  const waypoints = store.get("navigator/route")?.waypoints.length;
  if (id === "ROUTE" && waypoints) parts.push(ACTIVITY_TEXTS.waypoint(command.waypoint_index + 1, waypoints));
  const courtesy = store.isFresh("navigator/prediction", now) ? store.get("navigator/prediction").courtesy : "";
  if (courtesy) parts.push(courtesy.charAt(0).toLowerCase() + courtesy.slice(1));
  else if (planned.length) parts.push(`${ACTIVITY_TEXTS.plannedFor} ${trackNames(tracks, planned)}`);
  return activity(id, parts.filter(Boolean).join(", "));
}
