// @ts-check
// Points, segments and areas of the map, in metres east and north. Pure.

/** @typedef {{x_m: number, y_m: number}} Point */
/** @typedef {{keep: string, corners: Point[], name?: string}} Area */

/** @param {Point} a @param {Point} b */
export const distance = (a, b) => Math.hypot(b.x_m - a.x_m, b.y_m - a.y_m);

/** @param {Point} a @param {Point} b @param {number} part of the way from a to b @returns {Point} */
export const between = (a, b, part) => ({ x_m: a.x_m + part * (b.x_m - a.x_m), y_m: a.y_m + part * (b.y_m - a.y_m) });

/** The point of the segment nearest to `at`. @param {Point} at @param {Point} a @param {Point} b */
export function nearest(at, a, b) {
  const x = b.x_m - a.x_m, y = b.y_m - a.y_m, length2 = x * x + y * y;
  const part = length2 ? ((at.x_m - a.x_m) * x + (at.y_m - a.y_m) * y) / length2 : 0;
  return between(a, b, Math.min(1, Math.max(0, part)));
}

/** Segments from each point to the next. @param {Point[]} points @param {boolean} closed the last leads to the first @returns {[Point, Point][]} */
export const segments = (points, closed) =>
  points.length < 2 ? [] : (closed ? points : points.slice(0, -1)).map((point, index) => [point, points[(index + 1) % points.length]]);

/** Where two segments cross or touch; null where they do not, or are parallel. @param {[Point, Point]} one @param {[Point, Point]} other */
export function crossing([a, b], [c, d]) {
  const [ux, uy, vx, vy] = [b.x_m - a.x_m, b.y_m - a.y_m, d.x_m - c.x_m, d.y_m - c.y_m], cross = ux * vy - uy * vx;
  if (!cross) return null;
  const part = ((c.x_m - a.x_m) * vy - (c.y_m - a.y_m) * vx) / cross, along = ((c.x_m - a.x_m) * uy - (c.y_m - a.y_m) * ux) / cross;
  return part >= 0 && part <= 1 && along >= 0 && along <= 1 ? between(a, b, part) : null;
}

/** Whether the area contains the point: a ray to the east crosses its edges an odd number of times. @param {Area} area @param {Point} at */
export function contains(area, at) {
  let inside = false;
  for (const [a, b] of segments(area.corners, true)) {
    if (a.y_m > at.y_m !== b.y_m > at.y_m && at.x_m < ((b.x_m - a.x_m) * (at.y_m - a.y_m)) / (b.y_m - a.y_m) + a.x_m) inside = !inside;
  }
  return inside;
}

/** Inside an area that keeps in, if there is one, and in none that keeps out. @param {Area[]} fence @param {Point} at */
export function isAllowed(fence, at) {
  const inner = fence.filter((area) => area.keep === "in");
  return (!inner.length || inner.some((area) => contains(area, at))) && !fence.some((area) => area.keep === "out" && contains(area, at));
}

/** Distance to the nearest edge that bounds where the boat may be; infinite without a fence. @param {Area[]} fence @param {Point} at */
export function clearance(fence, at) {
  let least = Infinity;
  for (const area of fence) {
    for (const [a, b] of segments(area.corners, true)) {
      const point = nearest(at, a, b);
      const isInner = area.keep === "in" && fence.some((other) => other !== area && other.keep === "in" && contains(other, point));
      if (!isInner) least = Math.min(least, distance(at, point));
    }
  }
  return least;
}
