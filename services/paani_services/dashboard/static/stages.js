// @ts-check
// The way from the advice to the thrust, stage by stage: what each does now, or why it lets nothing through.

import { findInhibits } from "./inhibits.js";
import { computed, html, moment } from "./templates.js";
import { STAGES, STAGE_TEXTS, fixed, headingDeg, operatorText, sentence, trackNames, words } from "./text.js";

const SHOWN = ["operator", "mission", "planner", "fence", "controller", "gate"];

/** Every reason why the boat does not move, at the moment shown. */
export const inhibits = computed(() => findInhibits(moment.value.store, moment.value.now));

export function stages() {
  const does = describeStages(moment.value.store);
  return html`<ol id="stages" class="stages" aria-label=${STAGE_TEXTS.label}>${SHOWN.map((stage) => {
    const reasons = inhibits.value.filter((reason) => reason.stage === stage).map((reason) => reason.text), [text, acts] = does[stage];
    return (text || reasons.length > 0) && html`<li key=${stage} data-state=${reasons.length ? "failed" : acts ? "acts" : "passed"}><span>${STAGES[stage][0]}</span><b>${sentence(reasons.join("; ") || text)}</b></li>`;
  })}</ol>`;
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
    fence: [describeFence([...(mission?.fence ?? []), ...(mission?.land ?? [])]), false],
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
