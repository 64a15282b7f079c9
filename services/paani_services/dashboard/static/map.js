// @ts-check
// The map panel in local metres: fence, land, mission, route, way ahead, moving obstacles, estimated and true track.

import { drawBoat, drawRoute, drawTrack } from "./map_boat.js";
import { MapControls } from "./map_controls.js";
import { drawGrid, drawScale } from "./map_ground.js";
import { MapHeadings } from "./map_headings.js";
import { MapLabels } from "./map_labels.js";
import { drawFence, drawGhost, drawHome, drawLand, drawObstacles, drawPath, drawRally, drawStations } from "./map_objects.js";
import { MapTiles } from "./map_tiles.js";
import { MapProjection, NORTH_RAD, placeAhead } from "./map_projection.js";
import { isReplay } from "./inhibits.js";
import { RouteEditor } from "./route_editor.js";
import { MAP_TEXTS, byId, fixed, screenScale, setText } from "./text.js";

const FIT_PX = 36; // of the map that a whole route leaves free, for its numbers
const AHEAD_PART = 0.22; // of the map's height, by which the boat stands below the middle where its bow is up

export class MapPanel {
  constructor() {
    this.canvas = /** @type {HTMLCanvasElement} */ (byId("map"));
    this.ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    this.projection = new MapProjection({ x: 0, y: 0 }, 6, NORTH_RAD, 1, 1);
    this.pxPerM = 6;
    /** By how much larger everything is drawn; all other lengths on the screen are without it. */
    this.scale = 1;
    /** The place in the middle; null: wherever the boat is first. @type {import("./map_projection.js").Place | null} */
    this.centre = null;
    this.fitRoute = false;
    this.controls = new MapControls((factor) => this.zoom(factor), () => { this.fitRoute = true; this.controls.setFollow(false); });
    this.headings = new MapHeadings(this.canvas, (event) => this.pixelUnder(event));
    this.tiles = new MapTiles();
    this.bindPointer();
    this.editor = new RouteEditor(this);
  }

  bindPointer() {
    this.canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(event.deltaY < 0 ? 1.15 : 1 / 1.15); }, { passive: false });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons || this.editor.isDragging) return;
      this.controls.setFollow(false);
      this.centre = this.projection.dragged(event.movementX / this.scale, event.movementY / this.scale);
      this.project();
    });
  }

  /** @param {number} factor */
  zoom(factor) {
    this.pxPerM = Math.min(80, Math.max(0.5, this.pxPerM * factor));
  }

  /** What was drawn under the pointer: a canvas that was laid out anew is stretched until it is drawn again. @param {MouseEvent} event @returns {[number, number]} */
  pixelUnder({ clientX, clientY }) {
    const box = this.canvas.getBoundingClientRect(), { width, height } = this.projection;
    return [((clientX - box.left) * width) / box.width, ((clientY - box.top) * height) / box.height];
  }

  /** The place in metres under the pointer. @param {MouseEvent} event */
  placeUnder(event) {
    const { x, y } = this.projection.toMap(...this.pixelUnder(event));
    return { x_m: x, y_m: y };
  }

  /** Lay the map anew. @param {number} [upRad] direction that points up */
  project(upRad = NORTH_RAD - this.projection.turnRad) {
    const { canvas, pxPerM, scale } = this;
    this.projection = new MapProjection(this.centre ?? { x: 0, y: 0 }, pxPerM, upRad, canvas.clientWidth / scale, canvas.clientHeight / scale);
  }

  /** @param {import("./view.js").View} view @param {number} now */
  render({ store, tracks }, now) {
    this.editor.renderForm(store, now); // first, since it may take of the map's room
    const { canvas, ctx, controls } = this, scale = (this.scale = screenScale()), width = canvas.clientWidth / scale, height = canvas.clientHeight / scale;
    if (!width || !height) return;
    const odometry = store.get("localization/odometry"), truth = store.get("@truth/pose"), route = store.get("navigator/route"), pose = odometry ?? truth;
    const mission = store.get("navigator/mission"), bounds = route?.waypoints ?? mission?.fence[0]?.corners;
    if (this.fitRoute && bounds) this.fitTo(bounds);
    const upRad = controls.upRad(pose, this.editor.isOpen);
    if (pose && (controls.follow || !this.centre)) this.centre = placeAhead(pose, upRad, controls.isBoatUp && !this.editor.isOpen ? (AHEAD_PART * height) / this.pxPerM : 0);
    this.project(upRad);
    const { projection, pxPerM } = this, { turnRad } = projection, ratio = scale * Math.min(devicePixelRatio || 1, 2);
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const css = getComputedStyle(document.documentElement), colour = (/** @type {string} */ name) => css.getPropertyValue(name).trim();
    const toScreen = (/** @type {number} */ x, /** @type {number} */ y) => projection.toScreen(x, y);
    const labels = new MapLabels(), chart = { ctx, toScreen, turnRad, pxPerM, colour, labels };
    this.tiles.render(ctx, projection, odometry, colour("--panel"), Number(colour("--tiles")));
    drawGrid(ctx, projection, colour("--line"));
    this.drawGiven(chart, store, mission, route);
    drawTrack(chart, tracks["@truth/pose"], "--text", 1.5, [2, 4]);
    drawTrack(chart, tracks["localization/odometry"], "--cyan", 2, []);
    const prediction = store.isFresh("navigator/prediction", now) ? store.get("navigator/prediction") : undefined;
    if (prediction) this.drawPrediction(chart, store, prediction, pose, now);
    if (truth) drawBoat(chart, truth, "--text", false, store.isFresh("@truth/pose", now));
    if (odometry) drawBoat(chart, odometry, "--cyan", true, store.isFresh("localization/odometry", now));
    const poseAgeS = store.ageS("localization/odometry", now);
    const isOver = isReplay(store) && store.silenceS(now) > store.limitS("localization/odometry"); // nobody is lost where a recording ends
    if (odometry && poseAgeS > store.limitS("localization/odometry") && !isOver) drawGhost(chart, odometry, poseAgeS);
    labels.draw(ctx, colour);
    this.headings.render(chart, prediction?.headings ?? [], odometry, store.get("dashboard/settings")?.planner ?? true, this.editor.isOpen);
    this.editor.draw(chart);
    drawScale(ctx, projection, colour("--quiet"), colour("--panel"));
    controls.render(turnRad, this.editor.isOpen);
    setText(byId("map-pose"), pose ? MAP_TEXTS.pose(fixed(pose.x_m, 1), fixed(pose.y_m, 1)) : MAP_TEXTS.noPose);
    const error = odometry && truth ? Math.hypot(odometry.x_m - truth.x_m, odometry.y_m - truth.y_m) : NaN;
    setText(byId("map-error"), Number.isFinite(error) ? `${MAP_TEXTS.error} ${fixed(error, 1)} m` : "");
  }

  /** What the boat was told. @param {import("./map_objects.js").Chart} chart @param {import("./store.js").Store} store @param {any} mission @param {any} route */
  drawGiven(chart, store, mission, route) {
    byId("map-land").hidden = !mission?.land?.length;
    if (mission) drawLand(chart, mission);
    if (mission) drawFence(chart, mission);
    if (mission) drawStations(chart, mission);
    if (mission) drawRally(chart, mission);
    if (route) drawRoute(chart, route, store.get("navigator/command")?.waypoint_index ?? -1, store.get("dashboard/settings")?.acceptance_m ?? 1);
  }

  /** What the boat is about to do. @param {import("./map_objects.js").Chart} chart @param {import("./store.js").Store} store @param {any} prediction @param {any} pose @param {number} now */
  drawPrediction(chart, store, prediction, pose, now) {
    if (prediction.home.length) drawHome(chart, prediction.home[0]);
    if (prediction.path.length) drawPath(chart, prediction.path);
    drawObstacles(chart, prediction.obstacles, pose, store.ageS("navigator/prediction", now), store.get("advisor/tracks")?.tracks ?? []);
  }

  /** @param {{x_m: number, y_m: number}[]} points */
  fitTo(points) {
    const xs = points.map((p) => p.x_m), ys = points.map((p) => p.y_m), { canvas, scale } = this, width = canvas.clientWidth / scale, height = canvas.clientHeight / scale;
    const [x1, x2, y1, y2] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    this.centre = { x: (x1 + x2) / 2, y: (y1 + y2) / 2 };
    const room = (/** @type {number} */ px) => Math.max(px - FIT_PX, px / 2);
    this.pxPerM = Math.min(room(width) / (x2 - x1 + 6), room(height) / (y2 - y1 + 6));
    this.fitRoute = false;
  }
}
