// @ts-check
// The map panel in local metres, north up: fence, mission, route, way ahead, moving obstacles, estimated and true track.

import { drawFence, drawGhost, drawHome, drawObstacles, drawPath, drawStations } from "./map_objects.js";
import { RouteEditor } from "./route_editor.js";
import { byId, fixed, headingDeg, setText } from "./text.js";

const ROUND_LENGTHS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500];

export class MapPanel {
  constructor() {
    this.canvas = /** @type {HTMLCanvasElement} */ (byId("map"));
    this.ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    this.centre = { x: 0, y: 0 };
    this.pxPerM = 6;
    this.follow = true;
    this.bindControls();
    this.editor = new RouteEditor(this);
  }

  bindControls() {
    byId("map-follow").addEventListener("click", () => this.setFollow(!this.follow));
    byId("map-in").addEventListener("click", () => this.zoom(1.4));
    byId("map-out").addEventListener("click", () => this.zoom(1 / 1.4));
    byId("map-fit").addEventListener("click", () => { this.fitRoute = true; this.setFollow(false); });
    this.canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(event.deltaY < 0 ? 1.15 : 1 / 1.15); }, { passive: false });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons || this.editor.isDragging) return;
      this.setFollow(false);
      this.centre = { x: this.centre.x - event.movementX / this.pxPerM, y: this.centre.y + event.movementY / this.pxPerM };
    });
    this.fitRoute = false;
  }

  /** @param {boolean} follow */
  setFollow(follow) {
    this.follow = follow;
    byId("map-follow").setAttribute("aria-pressed", String(follow));
  }

  /** @param {number} factor */
  zoom(factor) {
    this.pxPerM = Math.min(80, Math.max(0.5, this.pxPerM * factor));
  }

  /** The place in metres under a pixel of the canvas. @param {number} x @param {number} y */
  toMap(x, y) {
    const { centre, pxPerM, canvas } = this;
    return { x_m: centre.x + (x - canvas.clientWidth / 2) / pxPerM, y_m: centre.y + (canvas.clientHeight / 2 - y) / pxPerM };
  }

  /** @param {import("./view.js").View} view @param {number} now */
  render({ store, tracks }, now) {
    const css = getComputedStyle(document.documentElement), colour = (/** @type {string} */ name) => css.getPropertyValue(name).trim();
    const odometry = store.get("localization/odometry"), truth = store.get("@truth/pose"), route = store.get("navigator/route");
    const ratio = Math.min(devicePixelRatio || 1, 2), width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const mission = store.get("navigator/mission");
    const bounds = route?.waypoints ?? mission?.fence[0]?.corners;
    if (this.fitRoute && bounds) this.fitTo(bounds, width, height);
    const pose = odometry ?? truth;
    if (this.follow && pose) this.centre = { x: pose.x_m, y: pose.y_m };
    const { ctx } = this;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const toScreen = (/** @type {number} */ x, /** @type {number} */ y) =>
      /** @type {[number, number]} */ ([width / 2 + (x - this.centre.x) * this.pxPerM, height / 2 - (y - this.centre.y) * this.pxPerM]);
    this.drawGrid(width, height, toScreen, colour("--line"));
    const chart = { ctx, toScreen, pxPerM: this.pxPerM, colour };
    const key = "navigator/prediction", prediction = store.isFresh(key, now) ? store.get(key) : undefined;
    if (mission) drawFence(chart, mission);
    if (mission) drawStations(chart, mission);
    if (route) this.drawRoute(route, store, toScreen, colour("--route"), colour("--quiet"));
    this.drawTrack(tracks["@truth/pose"], toScreen, colour("--text"), 1.5, [2, 4]);
    this.drawTrack(tracks["localization/odometry"], toScreen, colour("--cyan"), 2, []);
    if (prediction?.home.length) drawHome(chart, prediction.home[0]);
    if (prediction?.path.length) drawPath(chart, prediction.path);
    if (prediction) drawObstacles(chart, prediction.obstacles, store.ageS(key, now), store.get("advisor/tracks")?.tracks ?? []);
    if (truth) this.drawBoat(truth, toScreen, colour("--text"), false, store.isFresh("@truth/pose", now));
    if (odometry) this.drawBoat(odometry, toScreen, colour("--cyan"), true, store.isFresh("localization/odometry", now));
    const poseAgeS = store.ageS("localization/odometry", now);
    if (odometry && poseAgeS > store.limitS("localization/odometry")) drawGhost(chart, odometry, poseAgeS);
    this.editor.render(chart, store, now);
    this.drawScaleAndNorth(width, height, colour("--text"), colour("--quiet"));
    setText(byId("map-pose"), pose ? `${fixed(pose.x_m, 1)} m E, ${fixed(pose.y_m, 1)} m N, ${fixed(headingDeg(pose.yaw_rad), 0)}°` : "position unknown");
    const error = odometry && truth ? Math.hypot(odometry.x_m - truth.x_m, odometry.y_m - truth.y_m) : NaN;
    setText(byId("map-error"), Number.isFinite(error) ? `error ${fixed(error, 1)} m` : "");
  }

  /** @param {{x_m: number, y_m: number}[]} points @param {number} width @param {number} height */
  fitTo(points, width, height) {
    const xs = points.map((p) => p.x_m), ys = points.map((p) => p.y_m);
    const [x1, x2, y1, y2] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    this.centre = { x: (x1 + x2) / 2, y: (y1 + y2) / 2 };
    this.pxPerM = Math.min(width / (x2 - x1 + 12), height / (y2 - y1 + 12));
    this.fitRoute = false;
  }

  /** Metres east and north to pixels. @typedef {(x: number, y: number) => [number, number]} ToScreen */

  /** @param {number} width @param {number} height @param {ToScreen} toScreen @param {string} colour */
  drawGrid(width, height, toScreen, colour) {
    const step = ROUND_LENGTHS_M.find((m) => m * this.pxPerM >= 56) ?? 500;
    const { ctx } = this, [x0, y0] = toScreen(0, 0), px = step * this.pxPerM;
    ctx.strokeStyle = colour;
    ctx.lineWidth = 1;
    ctx.globalAlpha = 0.55;
    ctx.beginPath();
    for (let x = ((x0 % px) + px) % px; x < width; x += px) { ctx.moveTo(Math.round(x) + 0.5, 0); ctx.lineTo(Math.round(x) + 0.5, height); }
    for (let y = ((y0 % px) + px) % px; y < height; y += px) { ctx.moveTo(0, Math.round(y) + 0.5); ctx.lineTo(width, Math.round(y) + 0.5); }
    ctx.stroke();
    ctx.globalAlpha = 1;
  }

  /** @param {any} route @param {import("./store.js").Store} store @param {ToScreen} toScreen @param {string} colour @param {string} quiet */
  drawRoute(route, store, toScreen, colour, quiet) {
    const { ctx } = this, next = store.get("navigator/command")?.waypoint_index ?? -1;
    const acceptancePx = (store.get("dashboard/settings")?.acceptance_m ?? 1) * this.pxPerM;
    ctx.strokeStyle = colour;
    ctx.lineWidth = 1.5;
    ctx.beginPath();
    for (const point of route.waypoints) ctx.lineTo(...toScreen(point.x_m, point.y_m));
    if (route.repeat) ctx.closePath();
    ctx.stroke();
    route.waypoints.forEach((/** @type {any} */ point, /** @type {number} */ index) => {
      const [x, y] = toScreen(point.x_m, point.y_m), isNext = index === next;
      ctx.fillStyle = ctx.strokeStyle = colour;
      ctx.beginPath();
      ctx.arc(x, y, isNext ? 4 : 2.5, 0, 7);
      ctx.fill();
      ctx.globalAlpha = isNext ? 1 : 0.35;
      ctx.beginPath();
      ctx.arc(x, y, Math.max(acceptancePx, 4), 0, 7);
      ctx.stroke();
      ctx.globalAlpha = 1;
      if (isNext) {
        ctx.fillStyle = quiet;
        ctx.font = "12px system-ui, sans-serif";
        ctx.fillText(`next ${index + 1}`, x + Math.max(acceptancePx, 4) + 5, y + 4);
      }
    });
  }

  /** @param {{x: number, y: number}[]} points @param {ToScreen} toScreen @param {string} colour @param {number} thick @param {number[]} dash */
  drawTrack(points, toScreen, colour, thick, dash) {
    const { ctx } = this;
    ctx.strokeStyle = colour;
    ctx.lineWidth = thick;
    ctx.setLineDash(dash);
    ctx.globalAlpha = 0.85;
    ctx.beginPath();
    for (const point of points) ctx.lineTo(...toScreen(point.x, point.y));
    ctx.stroke();
    ctx.setLineDash([]);
    ctx.globalAlpha = 1;
  }

  /** @param {any} pose @param {ToScreen} toScreen @param {string} colour @param {boolean} filled @param {boolean} fresh */
  drawBoat(pose, toScreen, colour, filled, fresh) {
    const { ctx } = this, [x, y] = toScreen(pose.x_m, pose.y_m), size = Math.max(9, 0.9 * this.pxPerM);
    ctx.save();
    ctx.globalAlpha = fresh ? 1 : 0.35;
    ctx.translate(x, y);
    if (filled && pose.position_std_m) {
      ctx.strokeStyle = colour;
      ctx.globalAlpha *= 0.5;
      ctx.beginPath();
      ctx.arc(0, 0, pose.position_std_m * this.pxPerM, 0, 7);
      ctx.stroke();
      ctx.globalAlpha = fresh ? 1 : 0.35;
    }
    ctx.rotate(-pose.yaw_rad);
    ctx.beginPath();
    ctx.moveTo(size, 0);
    ctx.lineTo(-size * 0.7, size * 0.55);
    ctx.lineTo(-size * 0.4, 0);
    ctx.lineTo(-size * 0.7, -size * 0.55);
    ctx.closePath();
    ctx.fillStyle = ctx.strokeStyle = colour;
    ctx.lineWidth = 1.5;
    if (filled) ctx.fill();
    else ctx.stroke();
    ctx.restore();
  }

  /** Scale bar and north. @param {number} width @param {number} height @param {string} colour @param {string} quiet */
  drawScaleAndNorth(width, height, colour, quiet) {
    const { ctx } = this, metres = ROUND_LENGTHS_M.find((m) => m * this.pxPerM >= 60) ?? 500, px = metres * this.pxPerM;
    ctx.strokeStyle = ctx.fillStyle = quiet;
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(12, height - 18); ctx.lineTo(12, height - 12); ctx.lineTo(12 + px, height - 12); ctx.lineTo(12 + px, height - 18);
    ctx.stroke();
    ctx.font = "12px system-ui, sans-serif";
    ctx.fillText(`${metres} m`, 12, height - 24);
    ctx.fillStyle = colour;
    ctx.beginPath();
    ctx.moveTo(width - 20, 12); ctx.lineTo(width - 14, 30); ctx.lineTo(width - 20, 26); ctx.lineTo(width - 26, 30);
    ctx.fill();
    ctx.fillText("N", width - 24, 44);
  }
}
