// @ts-check
// What is wrong with a mission while it is drawn, each at its place on the map. The operator's process checks it again,
// exactly and whole, before it is in force; these marks say beforehand where it would refuse, and what it does not know:
// a turn too tight for the hull, and cells in which the boat has seen something. Pure.

import { FAULT_TEXTS } from "./text.js";
import { between, clearance, crossing, distance, isAllowed, segments } from "./plane_geometry.js";

const STEP_M = 0.5, MAX_STEPS = 400; // along a segment
const MAX_TESTS = 2e6; // of a place against an edge: of a large mission fewer places are tried, so that the page answers
const SAME_M = 0.01, MIN_AREA_M2 = 1, MAX_WAYPOINTS = 10000, MAX_CORNERS = 1000, MAX_PAIRS = 1e6, MAX_LEGS = 100, MAX_RALLY = 20, MAX_RALLY_PAIRS = 5000;
const OCCUPIED = 2; // as `Occupancy` in messages/occupancy.py

/**
 * @typedef {import("./plane_geometry.js").Point} Point
 * @typedef {{kind: string, waypoints: Point[], repeat: boolean, laps: number, radius_m: number, duration_s: number, speed_mps: number}} Leg
 * `rally`: at most one, whose waypoints are the rally points.
 * @typedef {{legs: Leg[], fence: import("./plane_geometry.js").Area[], rally: Leg[]}} Plan
 * `land`: what the boat's files name so; no client changes it.
 * @typedef {{marginM: number, turnRadiusM: number, land?: import("./plane_geometry.js").Area[]}} Limits
 * @typedef {{at: Point | null, text: string}} Mark
 */

/** @param {Plan} plan @param {Limits} limits @param {any} [grid] the navigator's `OccupancyGrid` @returns {Mark[]} */
export function findMarks(plan, limits, grid) {
  const cells = grid ? unpack(grid) : null, counts = countMarks(plan, limits);
  if (counts.some(({ isTooMuch }) => isTooMuch)) return counts;
  return [
    ...counts,
    ...plan.fence.flatMap((area, index) => areaMarks(area, FAULT_TEXTS.area(area.keep === "in", index + 1))),
    ...plan.legs.flatMap((leg, index) => legMarks(leg, FAULT_TEXTS.leg(index + 1), plan, limits, cells)),
    ...plan.rally.flatMap((leg) => legMarks(leg, FAULT_TEXTS.rally, plan, limits, cells)),
  ];
}

/** @param {Plan} plan @param {Limits} limits */
const sizeOf = ({ legs, fence, rally }, { land = [] }) => ({
  rally: rally.reduce((all, leg) => all + leg.waypoints.length, 0),
  waypoints: legs.reduce((all, leg) => all + leg.waypoints.length, 0),
  corners: [...fence, ...land].reduce((all, area) => all + area.corners.length, 0),
});

/** Faults of numbers; with one that is too much nothing else is looked at. @param {Plan} plan @param {Limits} limits @returns {(Mark & {isTooMuch: boolean})[]} */
function countMarks(plan, limits) {
  const { legs } = plan, { waypoints, corners, rally } = sizeOf(plan, limits);
  const endless = legs.findIndex((leg) => leg.kind === "follow_route" && leg.laps === 0), found = [];
  if (waypoints > MAX_WAYPOINTS) found.push(FAULT_TEXTS.tooManyWaypoints(MAX_WAYPOINTS));
  if (corners > MAX_CORNERS) found.push(FAULT_TEXTS.tooManyCorners(MAX_CORNERS));
  if (waypoints * corners > MAX_PAIRS) found.push(FAULT_TEXTS.tooManyPairs(waypoints, corners, MAX_PAIRS));
  if (legs.length > MAX_LEGS) found.push(FAULT_TEXTS.tooManyLegs(MAX_LEGS));
  if (rally > MAX_RALLY) found.push(FAULT_TEXTS.tooManyRally(MAX_RALLY));
  if (rally * corners > MAX_RALLY_PAIRS) found.push(FAULT_TEXTS.tooManyRallyPairs(rally, corners, MAX_RALLY_PAIRS));
  /** @type {(Mark & {isTooMuch: boolean})[]} */
  const marks = found.map((text) => ({ at: null, text, isTooMuch: true }));
  if (endless >= 0 && endless < legs.length - 1) marks.push({ at: null, text: FAULT_TEXTS.endless(endless + 1), isTooMuch: false });
  return marks;
}

/** @param {import("./plane_geometry.js").Area} area @param {string} name @returns {Mark[]} */
function areaMarks({ corners }, name) {
  if (corners.length < 3) return [{ at: corners[0] ?? null, text: `${name}: ${FAULT_TEXTS.fewCorners}` }];
  const edges = segments(corners, true);
  for (let one = 0; one < edges.length; one++) {
    if (distance(...edges[one]) < SAME_M) return [{ at: corners[one], text: `${name}: ${FAULT_TEXTS.sameCorners}` }];
    for (let other = one + 2; other < edges.length; other++) {
      const at = one === 0 && other === edges.length - 1 ? null : crossing(edges[one], edges[other]);
      if (at) return [{ at, text: `${name}: ${FAULT_TEXTS.crossing}` }];
    }
  }
  const area = Math.abs(edges.reduce((all, [a, b]) => all + a.x_m * b.y_m - b.x_m * a.y_m, 0)) / 2;
  return area < MIN_AREA_M2 ? [{ at: corners[0], text: `${name}: ${FAULT_TEXTS.smallArea}` }] : [];
}

/** @param {Leg} leg @param {string} name @param {Plan} plan @param {Limits} limits @param {ReturnType<typeof unpack> | null} cells @returns {Mark[]} */
function legMarks(leg, name, plan, limits, cells) {
  const { waypoints } = leg;
  if (leg.kind === "follow_route" && waypoints.length < 2) return [{ at: waypoints[0] ?? null, text: `${name}: ${FAULT_TEXTS.fewWaypoints}` }];
  /** @type {Mark[]} */
  const found = [], { land = [] } = limits, { waypoints: all, corners } = sizeOf(plan, limits), most = Math.min(MAX_STEPS, Math.ceil(MAX_TESTS / (2 * Math.max(1, all) * Math.max(1, corners))));
  const isLine = waypoints.length > 1 && leg.kind !== "rally";
  const ways = isLine ? segments(waypoints, leg.repeat) : waypoints.map((at) => /** @type {[Point, Point]} */ ([at, at]));
  ways.forEach(([a, b], index) => {
    const where = `${name}, ${FAULT_TEXTS.waypoint} ${index + 1}`;
    if (isLine && distance(a, b) < SAME_M) found.push({ at: a, text: `${where}: ${FAULT_TEXTS.sameWaypoint}` });
    for (const { areas, beyond, near } of [{ areas: plan.fence, beyond: FAULT_TEXTS.outside, near: FAULT_TEXTS.near }, { areas: land, beyond: FAULT_TEXTS.land, near: FAULT_TEXTS.nearLand }]) {
      const outside = firstAlong(a, b, most, (at) => !isAllowed(areas, at)), tooNear = outside ? null : firstAlong(a, b, most, (at) => clearance(areas, at) < limits.marginM);
      if (outside) found.push({ at: outside, text: `${where}: ${beyond}` });
      if (tooNear) found.push({ at: tooNear, text: `${where}: ${near(limits.marginM)}` });
    }
    const seen = cells && firstAlong(a, b, most, (at) => isOccupied(cells, at));
    if (seen) found.push({ at: seen, text: `${where}: ${FAULT_TEXTS.occupied}` });
  });
  return leg.kind === "follow_route" ? [...found, ...turnMarks(leg, name, limits.turnRadiusM)] : found;
}

/**
 * A turn by an angle on a circle takes radius * tan(angle / 2) of the way before and after it; half of each way is there.
 * @param {Leg} leg @param {string} name @param {number} radiusM @returns {Mark[]}
 */
function turnMarks({ waypoints, repeat }, name, radiusM) {
  const count = waypoints.length;
  if (!radiusM || count < 3) return [];
  return waypoints.flatMap((at, index) => {
    if (!repeat && (index === 0 || index === count - 1)) return [];
    const before = waypoints[(index + count - 1) % count], after = waypoints[(index + 1) % count];
    const turn = Math.abs(angle(Math.atan2(after.y_m - at.y_m, after.x_m - at.x_m) - Math.atan2(at.y_m - before.y_m, at.x_m - before.x_m)));
    const room = 0.5 * Math.min(distance(before, at), distance(at, after));
    return radiusM * Math.tan(turn / 2) > room ? [{ at, text: `${name}, ${FAULT_TEXTS.waypoint} ${index + 1}: ${FAULT_TEXTS.tight(radiusM)}` }] : [];
  });
}

/** @param {number} rad */
const angle = (rad) => Math.atan2(Math.sin(rad), Math.cos(rad));

/** @param {Point} a @param {Point} b @param {number} most steps @param {(at: Point) => boolean} isWrong */
function firstAlong(a, b, most, isWrong) {
  const steps = Math.max(1, Math.min(most, Math.ceil(distance(a, b) / STEP_M)));
  for (let step = 0; step <= steps; step++) {
    const at = between(a, b, step / steps);
    if (isWrong(at)) return at;
  }
  return null;
}

/** Two bits a cell, the first in the lowest of the first byte. @param {any} grid */
function unpack(grid) {
  return { ...grid, bytes: Uint8Array.from(atob(grid.cells), (char) => char.charCodeAt(0)) };
}

/** @param {ReturnType<typeof unpack>} grid @param {Point} at */
function isOccupied(grid, at) {
  const column = Math.floor((at.x_m - grid.west_m) / grid.cell_m), row = Math.floor((at.y_m - grid.south_m) / grid.cell_m);
  if (column < 0 || row < 0 || column >= grid.columns || row >= grid.rows) return false;
  const index = row * grid.columns + column;
  return ((grid.bytes[index >> 2] >> (2 * (index & 3))) & 3) === OCCUPIED;
}
