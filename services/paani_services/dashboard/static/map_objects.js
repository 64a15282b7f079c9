// @ts-check
// Draws on the map what the boat is told and what it sees coming: fence, land, stations, rally points, home, the way ahead, moving obstacles.

import { MAP_TEXTS, ageText, trackNames } from "./text.js";

const ARROW_S = 5; // a velocity is drawn as the way of this long
const GHOST_S = 30; // no boat that nobody hears is said to go straight on for longer

/** Metres east and north to pixels. @typedef {(x: number, y: number) => [number, number]} ToScreen */
/** turnRad: by which every direction is turned, counter-clockwise. @typedef {{ctx: CanvasRenderingContext2D, toScreen: ToScreen, turnRad: number, pxPerM: number, colour: (name: string) => string, labels: import("./map_labels.js").MapLabels}} Chart */

/** Land, filled: it lies under everything else that is drawn. @param {Chart} chart @param {any} mission */
export function drawLand({ ctx, toScreen, colour }, mission) {
  ctx.fillStyle = ctx.strokeStyle = colour("--land");
  ctx.lineWidth = 2;
  for (const area of mission.land ?? []) {
    ctx.beginPath();
    for (const corner of area.corners) ctx.lineTo(...toScreen(corner.x_m, corner.y_m));
    ctx.closePath();
    ctx.globalAlpha = 0.35;
    ctx.fill();
    ctx.globalAlpha = 1;
    ctx.stroke();
  }
}

/** Areas to keep in are outlined, areas to keep out are hatched too. @param {Chart} chart @param {any} mission */
export function drawFence({ ctx, toScreen, colour }, mission) {
  for (const area of mission.fence) {
    const isOut = area.keep === "out";
    ctx.strokeStyle = colour(isOut ? "--red" : "--green");
    ctx.lineWidth = 2;
    ctx.setLineDash(isOut ? [] : [8, 4]);
    ctx.beginPath();
    for (const corner of area.corners) ctx.lineTo(...toScreen(corner.x_m, corner.y_m));
    ctx.closePath();
    ctx.stroke();
    ctx.setLineDash([]);
    if (isOut) hatch(ctx, area.corners.map((/** @type {any} */ corner) => toScreen(corner.x_m, corner.y_m)));
  }
}

/** Hatch the polygon whose path is the current one. @param {CanvasRenderingContext2D} ctx @param {[number, number][]} corners */
function hatch(ctx, corners) {
  const xs = corners.map(([x]) => x), ys = corners.map(([, y]) => y);
  const [left, right] = [Math.max(0, Math.min(...xs)), Math.min(ctx.canvas.width, Math.max(...xs))];
  const [top, bottom] = [Math.max(0, Math.min(...ys)), Math.min(ctx.canvas.height, Math.max(...ys))];
  if (right <= left || bottom <= top) return;
  ctx.save();
  ctx.clip();
  ctx.lineWidth = 1;
  ctx.globalAlpha = 0.6;
  ctx.beginPath();
  for (let x = left - (bottom - top); x < right; x += 8) {
    ctx.moveTo(x, bottom);
    ctx.lineTo(x + bottom - top, top);
  }
  ctx.stroke();
  ctx.restore();
}

/** The stations of the mission, by their radius. @param {Chart} chart @param {any} mission */
export function drawStations({ ctx, toScreen, pxPerM, colour }, mission) {
  ctx.strokeStyle = colour("--route");
  ctx.lineWidth = 1.5;
  ctx.setLineDash([3, 3]);
  for (const leg of mission.legs) {
    if (leg.kind !== "hold_station" || !leg.waypoints.length) continue;
    const [x, y] = toScreen(leg.waypoints[0].x_m, leg.waypoints[0].y_m);
    ctx.beginPath();
    ctx.arc(x, y, Math.max(6, leg.radius_m * pxPerM), 0, 7);
    ctx.stroke();
  }
  ctx.setLineDash([]);
}

/** Places that Return may lead to, flags. @param {Chart} chart @param {any} mission */
export function drawRally({ ctx, toScreen, colour }, mission) {
  ctx.strokeStyle = ctx.fillStyle = colour("--route");
  ctx.lineWidth = 2;
  for (const point of mission.rally ?? []) {
    const [x, y] = toScreen(point.x_m, point.y_m);
    ctx.beginPath();
    ctx.moveTo(x, y); ctx.lineTo(x, y - 16); ctx.lineTo(x + 10, y - 12); ctx.lineTo(x, y - 8);
    ctx.fill();
    ctx.stroke();
  }
}

/** Home, a house. @param {Chart} chart @param {{x_m: number, y_m: number}} home */
export function drawHome({ ctx, toScreen, colour }, home) {
  const [x, y] = toScreen(home.x_m, home.y_m);
  ctx.strokeStyle = ctx.fillStyle = colour("--route");
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(x - 8, y); ctx.lineTo(x, y - 8); ctx.lineTo(x + 8, y); ctx.moveTo(x - 5, y - 2); ctx.lineTo(x - 5, y + 7); ctx.lineTo(x + 5, y + 7); ctx.lineTo(x + 5, y - 2);
  ctx.stroke();
}

/**
 * Where the boat may be by now that was heard of last as `pose`: straight on at its speed, in a circle that grows with it.
 * @param {Chart} chart @param {any} pose @param {number} ageS
 */
export function drawGhost({ ctx, toScreen, pxPerM, colour, labels }, pose, ageS) {
  const goneS = Math.min(ageS, GHOST_S), wayM = pose.surge_mps * goneS;
  const [x, y] = toScreen(pose.x_m + wayM * Math.cos(pose.yaw_rad), pose.y_m + wayM * Math.sin(pose.yaw_rad));
  ctx.strokeStyle = ctx.fillStyle = colour("--red");
  ctx.lineWidth = 1.5;
  ctx.setLineDash([4, 4]);
  ctx.beginPath();
  ctx.moveTo(...toScreen(pose.x_m, pose.y_m));
  ctx.lineTo(x, y);
  ctx.stroke();
  ctx.beginPath();
  ctx.arc(x, y, Math.max(10, (Math.abs(wayM) + (pose.position_std_m ?? 0)) * pxPerM), 0, 7);
  ctx.stroke();
  ctx.setLineDash([]);
  labels.add([`${MAP_TEXTS.notHeard} ${ageText(ageS)}`], x + 13, y - 13, "--red");
}

/** The way ahead by the order in force. @param {Chart} chart @param {{x_m: number, y_m: number}[]} path */
export function drawPath({ ctx, toScreen, colour }, path) {
  ctx.strokeStyle = colour("--amber");
  ctx.lineWidth = 4;
  ctx.lineCap = "round";
  ctx.beginPath();
  for (const point of path) ctx.lineTo(...toScreen(point.x_m, point.y_m));
  ctx.stroke();
  ctx.lineCap = "butt";
}

/** Where something will be that goes on as it does. @param {any} from @param {number} eastMps @param {number} northMps @param {number} afterS @returns {[number, number]} */
const placeAfter = (from, eastMps, northMps, afterS) => [from.x_m + eastMps * afterS, from.y_m + northMps * afterS];

/**
 * Where an obstacle and the boat will be nearest to each other, joined by a line.
 * @param {Chart} chart @param {any} obstacle @param {any} pose of the boat @param {number} ageS of the message
 */
function drawClosest({ ctx, toScreen, colour }, obstacle, pose, ageS) {
  const cos = Math.cos(pose.yaw_rad), sin = Math.sin(pose.yaw_rad), swayMps = pose.sway_mps ?? 0;
  const boat = toScreen(...placeAfter(pose, pose.surge_mps * cos - swayMps * sin, pose.surge_mps * sin + swayMps * cos, Math.max(0, obstacle.tcpa_s - ageS)));
  const other = toScreen(...placeAfter(obstacle, obstacle.east_mps, obstacle.north_mps, obstacle.tcpa_s));
  ctx.strokeStyle = ctx.fillStyle = colour(obstacle.encounter && obstacle.encounter !== "none" ? "--amber" : "--orange");
  ctx.lineWidth = 1.5;
  ctx.setLineDash([2, 3]);
  ctx.beginPath();
  ctx.moveTo(...boat);
  ctx.lineTo(...other);
  ctx.stroke();
  ctx.setLineDash([]);
  for (const [x, y] of [boat, other]) ctx.fillRect(x - 3, y - 3, 6, 6);
}

/** How near an obstacle comes and when; empty where it comes no nearer. @param {any} obstacle @param {number} ageS of the message */
const closestText = (obstacle, ageS) => (isNearing(obstacle) ? MAP_TEXTS.nearest(obstacle.cpa_m, Math.max(0, obstacle.tcpa_s - ageS)) : "");

/** @param {any} obstacle */
const isNearing = (obstacle) => obstacle.cpa_m !== undefined && obstacle.tcpa_s > 0;

/**
 * Moving obstacles where they are by now, with the way they make in `ARROW_S`, their number, and the closest point of approach.
 * @param {Chart} chart @param {any[]} obstacles @param {any} pose of the boat @param {number} ageS of the message @param {{id: number, label: string}[]} tracks
 */
export function drawObstacles(chart, obstacles, pose, ageS, tracks) {
  const { ctx, toScreen, pxPerM, colour, labels } = chart;
  for (const obstacle of obstacles) {
    if (pose && isNearing(obstacle)) drawClosest(chart, obstacle, pose, ageS);
    const [east, north] = placeAfter(obstacle, obstacle.east_mps, obstacle.north_mps, ageS);
    const [x, y] = toScreen(east, north), radius = Math.max(6, obstacle.radius_m * pxPerM);
    ctx.strokeStyle = ctx.fillStyle = colour("--orange");
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.arc(x, y, radius, 0, 7);
    ctx.stroke();
    ctx.beginPath();
    ctx.arc(x, y, 2, 0, 7);
    ctx.fill();
    ctx.beginPath();
    ctx.moveTo(x, y);
    ctx.lineTo(...toScreen(east + obstacle.east_mps * ARROW_S, north + obstacle.north_mps * ARROW_S));
    ctx.stroke();
    const unseen = obstacle.mmsi ? `AIS ${obstacle.mmsi}` : obstacle.is_scanned ? "lidar" : "";
    const name = unseen || trackNames(tracks, [obstacle.track_id]);
    const lines = [name, closestText(obstacle, ageS)].filter(Boolean);
    labels.add(lines, x + radius + 4, y + 4, "--text");
  }
}
