// @ts-check
// The way from the advice to the thrust, stage by stage: what each does now, or why it lets nothing through.

import { findInhibits } from "./inhibits.js";
import { STAGES, STAGE_TEXTS, byId, fixed, headingDeg, make, operatorText, sentence, setText, trackNames, words } from "./text.js";

const SHOWN = ["operator", "mission", "planner", "fence", "controller", "gate"];

/** @param {import("./store.js").Store} store @param {number} now */
export function renderStages(store, now) {
  const list = byId("stages"), inhibits = findInhibits(store, now), does = describeStages(store);
  if (!list.children.length) {
    list.append(...SHOWN.map((stage) => {
      const item = make("li");
      item.append(make("span", "", STAGES[stage][0]), make("b"));
      return item;
    }));
  }
  SHOWN.forEach((stage, index) => {
    const reasons = inhibits.filter((reason) => reason.stage === stage).map((reason) => reason.text);
    const item = /** @type {HTMLElement} */ (list.children[index]), [text, acts] = does[stage];
    item.hidden = !text && !reasons.length;
    item.dataset.state = reasons.length ? "failed" : acts ? "acts" : "passed";
    setText(item.lastElementChild, sentence(reasons.join("; ") || text));
  });
}

/** What each stage does, and whether it changes what the advice or the route alone would do. @param {import("./store.js").Store} store @returns {Record<string, [string, boolean]>} */
function describeStages(store) {
  const operator = store.get("operator/state"), command = store.get("navigator/command"), route = store.get("navigator/route");
  const mission = store.get("navigator/mission"), thrust = store.get("controller/thrust"), applied = store.get("plant/thrust_applied");
  const waypoint = route && command ? STAGE_TEXTS.waypoint(command.waypoint_index + 1, route.waypoints.length, route.name) : "";
  const name = mission && mission.name !== route?.name ? `${mission.name}: ` : "";
  return {
    operator: [operator?.armed ? `${STAGE_TEXTS.armedBy} ${operatorText(operator.by)}` : "", false],
    mission: [command?.leg ? `${name}${command.leg}${command.leg.startsWith("follow route") ? waypoint : ""}` : "", false],
    planner: describePlanner(store, command),
    fence: [describeFence(mission?.fence ?? []), false],
    controller: [thrust?.enabled ? STAGE_TEXTS.errors(fixed(thrust.speed_error_mps), fixed((thrust.heading_error_rad * 180) / Math.PI, 0)) : "", false],
    gate: [applied ? STAGE_TEXTS.thrust(fixed(applied.left_n, 1), fixed(applied.right_n, 1)) : "", false],
  };
}

/** @param {{keep: string, name: string}[]} areas */
function describeFence(areas) {
  const names = (/** @type {string} */ keep) => areas.filter((area) => area.keep === keep).map((area) => area.name || STAGE_TEXTS.unnamed).join(", ");
  return [names("in") && `${STAGE_TEXTS.staysIn} ${names("in")}`, names("out") && `${STAGE_TEXTS.keepsOut} ${names("out")}`].filter(Boolean).join("; ");
}

/** @param {import("./store.js").Store} store @param {any} command @returns {[string, boolean]} */
function describePlanner(store, command) {
  if (!store.get("dashboard/settings")?.planner) return [STAGE_TEXTS.off, false];
  if (!command?.enable) return ["", false];
  const ids = command.obstacle_track_ids, heading = STAGE_TEXTS.steers(fixed(headingDeg(command.heading_rad), 0), fixed(command.speed_mps));
  const turn = /LEFT|RIGHT/.test(command.direction) ? `, ${STAGE_TEXTS.advised} ${words(command.direction)}` : "";
  return [`${heading}${turn}${ids.length ? `, ${STAGE_TEXTS.because} ${trackNames(store.get("advisor/tracks")?.tracks ?? [], ids)}` : ""}`, Boolean(ids.length || turn)];
}
