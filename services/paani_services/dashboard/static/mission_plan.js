// @ts-check
// The mission that is being drawn: legs, fence, rally points, which of them is at hand, and what undo brings back. Pure.

import { leg } from "./mission_files.js";
import { distance, nearest, segments } from "./plane_geometry.js";

const MAX_UNDO = 100;

/** @typedef {import("./plane_geometry.js").Point} Point @typedef {import("./mission_checks.js").Leg} Leg */

export class MissionPlan {
  constructor() {
    /** @type {import("./mission_checks.js").Plan} */
    this.plan = { legs: [], fence: [], rally: [] };
    /** The leg or area whose points are drawn: legs first, then areas, then the rally points together. */
    this.current = 0;
    /** The point at hand, of the current one; -1: none. */
    this.point = -1;
    /** @type {string[]} */
    this.past = [];
  }

  get items() {
    return [...this.plan.legs, ...this.plan.fence, ...this.plan.rally];
  }

  /** The points of a leg or an area; undefined where there is none. @param {number} [index] @returns {Point[] | undefined} */
  points(index = this.current) {
    const item = this.items[index];
    return item && ("corners" in item ? item.corners : item.waypoints);
  }

  /** Whether the last point leads to the first. @param {number} [index] */
  isClosed(index = this.current) {
    const item = this.items[index];
    return Boolean(item && ("corners" in item || item.repeat));
  }

  /** How many points the current one may have. */
  get room() {
    const item = this.items[this.current];
    return !item || "corners" in item || ["follow_route", "rally"].includes(item.kind) ? Infinity : item.kind === "stop" ? 0 : 1;
  }

  /** Remember what undo brings back; before a change, and once for a whole drag. */
  remember() {
    this.past.push(JSON.stringify([this.plan, this.current]));
    if (this.past.length > MAX_UNDO) this.past.shift();
  }

  undo() {
    const before = this.past.pop();
    if (before) [this.plan, this.current] = JSON.parse(before);
    this.point = -1;
  }

  /** Take another plan, which undo takes back. @param {import("./mission_checks.js").Plan} plan */
  replace(plan) {
    this.remember();
    this.plan = plan;
    this.current = 0;
    this.point = -1;
  }

  /** @param {string} kind of a leg, `in` or `out` of an area, or `rally`, of which there is one */
  addItem(kind) {
    this.remember();
    if (kind === "in" || kind === "out") {
      this.plan.fence.push({ keep: kind, corners: [] });
      this.current = this.plan.legs.length + this.plan.fence.length - 1;
    } else if (kind === "rally") {
      if (!this.plan.rally.length) this.plan.rally.push(leg([], { kind }));
      this.current = this.items.length - 1;
    } else {
      this.plan.legs.push(leg([], kind === "hold_station" ? { kind, radius_m: 3, duration_s: 60 } : { kind }));
      this.current = this.plan.legs.length - 1;
    }
    this.point = -1;
  }

  removeItem() {
    if (!this.items.length) return;
    this.remember();
    const { legs, fence, rally } = this.plan, areas = this.current - legs.length;
    if (areas < 0) legs.splice(this.current, 1);
    else if (areas < fence.length) fence.splice(areas, 1);
    else rally.length = 0;
    this.current = Math.max(0, this.current - 1);
    this.point = -1;
  }

  /** Change fields of the current leg. @param {Partial<Leg>} changes */
  change(changes) {
    this.remember();
    Object.assign(this.items[this.current], changes);
  }

  /** Add a point at the end, or move the one there may be. @param {Point} at */
  addPoint(at) {
    const points = this.points();
    if (!points || this.room === 0) return;
    this.remember();
    if (points.length >= this.room) points.length = 0;
    points.push(at);
    this.point = points.length - 1;
  }

  /** The point within reach, of any leg or area, the current one first; it is at hand then. @param {Point} at @param {number} reachM */
  grab(at, reachM) {
    for (const index of [this.current, ...this.items.keys()]) {
      const found = (this.points(index) ?? []).findIndex((point) => distance(point, at) <= reachM);
      if (found < 0) continue;
      this.current = index;
      this.point = found;
      return true;
    }
    return false;
  }

  /** Insert a point where a line of the current one is within reach. @param {Point} at @param {number} reachM */
  insert(at, reachM) {
    const points = this.points() ?? [], item = this.items[this.current];
    if (this.room < Infinity || (item && "kind" in item && item.kind === "rally")) return false;
    const index = segments(points, this.isClosed() && points.length > 2).findIndex(([a, b]) => distance(at, nearest(at, a, b)) <= reachM);
    if (index < 0) return false;
    this.remember();
    points.splice(index + 1, 0, at);
    this.point = index + 1;
    return true;
  }

  /** @param {Point} to */
  move(to) {
    const points = this.points();
    if (points?.[this.point]) points[this.point] = to;
  }

  removePoint() {
    const points = this.points();
    if (!points?.[this.point]) return;
    this.remember();
    points.splice(this.point, 1);
    this.point = Math.min(this.point, points.length - 1);
  }
}
