// @ts-check
// Why the planner took or refused each heading: which it took, what there is to say of each, and which is meant by a
// place on the map. Pure; the words are in text.js.

import { CONSTRAINTS, COSTS, HEADING_TEXTS, fixed, headingDeg } from "./text.js";

const LEAST_COST = 0.005; // less of a cost is not told
const MAX_COSTS = 4;
export const INNER_PX = 26, CELL_PX = 14; // of a ray around the boat: where it begins, and its length for each speed
const REACH_PX = 14, REACH_RAD = 0.3;

/** @typedef {{heading_rad: number, refused_by: string[], speed_mps: number, costs?: Record<string, number>}} Verdict */

/** @param {Verdict} verdict */
const total = ({ costs }) => (costs ? Object.values(costs).reduce((sum, cost) => sum + cost, 0) : Infinity);

/** The angle by which one is to the left of the other, in (-pi, pi]. @param {number} rad @param {number} otherRad */
const leftOf = (rad, otherRad) => Math.PI - (((Math.PI - (rad - otherRad)) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI);

/** The cheapest heading that nothing refuses; undefined where all are refused. @param {Verdict[]} verdicts */
export const findTaken = (verdicts) => verdicts.reduce((/** @type {Verdict | undefined} */ best, each) => (total(each) < (best ? total(best) : Infinity) ? each : best), undefined);

/** From port to starboard of the desired course, which comes first on the bus. @param {Verdict[]} verdicts */
export const fromPort = (verdicts) => verdicts.toSorted((a, b) => leftOf(b.heading_rad, verdicts[0].heading_rad) - leftOf(a.heading_rad, verdicts[0].heading_rad));

/** The one nearest to a heading. @param {Verdict[]} verdicts @param {number} headingRad */
export const nearestTo = (verdicts, headingRad) => verdicts.reduce((best, each) => (Math.abs(leftOf(each.heading_rad, headingRad)) < Math.abs(leftOf(best.heading_rad, headingRad)) ? each : best));

/**
 * The ray at a place on the map, so many pixels right of and above the boat; undefined where there is none.
 * @param {Verdict[]} verdicts @param {number} rightPx @param {number} upPx @param {number} turnRad by which the map is turned
 */
export function rayAt(verdicts, rightPx, upPx, turnRad) {
  const far = Math.hypot(rightPx, upPx), most = INNER_PX + CELL_PX * Math.max(0, ...verdicts.map((each) => each.refused_by.length));
  if (!verdicts.length || far < INNER_PX - REACH_PX || far > most + REACH_PX) return undefined;
  const headingRad = Math.atan2(upPx, rightPx) - turnRad, found = nearestTo(verdicts, headingRad);
  return Math.abs(leftOf(found.heading_rad, headingRad)) <= REACH_RAD ? found : undefined;
}

/** In a few words. @param {Verdict} verdict @param {Verdict | undefined} taken */
export function nameVerdict(verdict, taken) {
  const state = verdict === taken ? HEADING_TEXTS.taken : verdict.costs ? HEADING_TEXTS.free : `${HEADING_TEXTS.refused}: ${CONSTRAINTS[verdict.refused_by[0]][0]}`;
  return `${degreesText(verdict)} ${state}`;
}

/** All there is to say. @param {Verdict} verdict @param {Verdict | undefined} taken */
export function describeVerdict(verdict, taken) {
  const reasons = refusalText(verdict.refused_by);
  if (!verdict.costs || !taken?.costs) return `${degreesText(verdict)} ${HEADING_TEXTS.refused}: ${reasons}.`;
  const costs = verdict.costs, others = taken.costs, isTaken = verdict === taken;
  const parts = Object.keys(costs).map((name) => ({ name, cost: costs[name] - (isTaken ? 0 : others[name] ?? 0) }));
  const told = parts.filter(({ cost }) => Math.abs(cost) >= LEAST_COST).sort((a, b) => Math.abs(b.cost) - Math.abs(a.cost)).slice(0, MAX_COSTS);
  const why = told.map(({ name, cost }) => `${COSTS[name] ?? name} ${isTaken || cost < 0 ? "" : "+"}${fixed(cost)}`).join(", ");
  const sum = isTaken ? `${HEADING_TEXTS.taken}, ${HEADING_TEXTS.costs} ${fixed(total(verdict))}` : `${HEADING_TEXTS.free}, ${HEADING_TEXTS.dearer} ${fixed(total(verdict) - total(taken))}`;
  return `${degreesText(verdict)} ${sum}${why ? `: ${why}` : ""}. ${fixed(verdict.speed_mps)} m/s${reasons ? `; ${reasons}` : ""}.`;
}

/** @param {Verdict} verdict */
const degreesText = ({ heading_rad: rad }) => `${String(Math.round(headingDeg(rad)) % 360).padStart(3, "0")}°`;

/** What refuses it at each speed; speeds alike are told once. @param {string[]} refusedBy the fastest first */
function refusalText(refusedBy) {
  const texts = refusedBy.map((name) => CONSTRAINTS[name]?.[1] ?? name), last = texts.length - 1;
  if (texts.every((text) => text === texts[0])) return texts[0];
  const { fastest, between, slowest } = HEADING_TEXTS.speeds;
  return texts.map((text, index) => text && `${index === 0 ? fastest : index === last ? slowest : between}: ${text}`).filter(Boolean).join("; ");
}
