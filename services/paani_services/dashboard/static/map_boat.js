// @ts-check
// Draws on the map where the boat is, where it was, and the route it follows.

import { MAP_TEXTS } from "./text.js";

/** @typedef {import("./map_objects.js").Chart} Chart */

/** @param {Chart} chart @param {any} route @param {number} next index of the waypoint ahead; -1: unknown @param {number} acceptanceM */
export function drawRoute({ ctx, toScreen, pxPerM, colour, labels }, route, next, acceptanceM) {
  const acceptancePx = acceptanceM * pxPerM;
  ctx.strokeStyle = colour("--route");
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  for (const point of route.waypoints) ctx.lineTo(...toScreen(point.x_m, point.y_m));
  if (route.repeat) ctx.closePath();
  ctx.stroke();
  route.waypoints.forEach((/** @type {any} */ point, /** @type {number} */ index) => {
    const [x, y] = toScreen(point.x_m, point.y_m), isNext = index === next;
    ctx.fillStyle = ctx.strokeStyle = colour("--route");
    ctx.beginPath();
    ctx.arc(x, y, isNext ? 4 : 2.5, 0, 7);
    ctx.fill();
    ctx.globalAlpha = isNext ? 1 : 0.35;
    ctx.beginPath();
    ctx.arc(x, y, Math.max(acceptancePx, 4), 0, 7);
    ctx.stroke();
    ctx.globalAlpha = 1;
    if (isNext) labels.add([`${MAP_TEXTS.next} ${index + 1}`], x + Math.max(acceptancePx, 4) + 5, y + 4, "--quiet");
  });
}

/** @param {Chart} chart @param {{x: number, y: number}[]} points @param {string} colourName @param {number} thick @param {number[]} dash */
export function drawTrack({ ctx, toScreen, colour }, points, colourName, thick, dash) {
  ctx.strokeStyle = colour(colourName);
  ctx.lineWidth = thick;
  ctx.setLineDash(dash);
  ctx.globalAlpha = 0.85;
  ctx.beginPath();
  for (const point of points) ctx.lineTo(...toScreen(point.x, point.y));
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
}

/** The half axes of the ellipse of one standard deviation [m]; a circle where only their mean is known. @param {any} pose */
export function errorAxesM({ position_std_m: meanM, position_major_std_m: majorM = 0 }) {
  if (!(majorM > meanM)) return [meanM, meanM];
  return [majorM, Math.sqrt(Math.max(2 * meanM ** 2 - majorM ** 2, 0))];
}

/** A wedge of one standard deviation to either side. @param {CanvasRenderingContext2D} ctx @param {number} headingRad on the screen, clockwise @param {number} deviationRad @param {number} farPx */
function drawHeadingDeviation(ctx, headingRad, deviationRad, farPx) {
  const halfRad = Math.min(deviationRad, Math.PI);
  ctx.beginPath();
  ctx.moveTo(0, 0);
  ctx.arc(0, 0, farPx, headingRad - halfRad, headingRad + halfRad);
  ctx.closePath();
  ctx.stroke();
}

/** @param {Chart} chart @param {any} pose @param {string} colourName @param {boolean} isEstimate filled, with its deviation @param {boolean} isFresh */
export function drawBoat({ ctx, toScreen, turnRad, pxPerM, colour }, pose, colourName, isEstimate, isFresh) {
  const [x, y] = toScreen(pose.x_m, pose.y_m), size = Math.max(9, 0.9 * pxPerM);
  ctx.save();
  ctx.globalAlpha = isFresh ? 1 : 0.35;
  ctx.fillStyle = ctx.strokeStyle = colour(colourName);
  ctx.translate(x, y);
  if (isEstimate && pose.position_std_m) {
    ctx.globalAlpha *= 0.5;
    ctx.lineWidth = 1;
    ctx.beginPath();
    const [majorM, minorM] = errorAxesM(pose);
    ctx.ellipse(0, 0, majorM * pxPerM, minorM * pxPerM, -((pose.position_major_rad ?? 0) + turnRad), 0, 2 * Math.PI);
    ctx.stroke();
    if (pose.yaw_std_rad) drawHeadingDeviation(ctx, -(pose.yaw_rad + turnRad), pose.yaw_std_rad, 2.5 * size);
    ctx.globalAlpha = isFresh ? 1 : 0.35;
  }
  ctx.rotate(-(pose.yaw_rad + turnRad));
  ctx.beginPath();
  ctx.moveTo(size, 0);
  ctx.lineTo(-size * 0.7, size * 0.55);
  ctx.lineTo(-size * 0.4, 0);
  ctx.lineTo(-size * 0.7, -size * 0.55);
  ctx.closePath();
  ctx.lineWidth = 1.5;
  if (isEstimate) ctx.fill();
  else ctx.stroke();
  ctx.restore();
}
