// @ts-check
// Missions as GPX and GeoJSON, as `paani route` and the navigator read and write them: one LineString or route, polygons
// with `keep`, points with `rally`; further legs, and points of stations, as features of their own with `leg`.

import { FILE_TEXTS } from "./text.js";

const SEMI_MAJOR_M = 6378137, ECCENTRICITY2 = 0.00669437999014; // WGS 84
const MAX_BYTES = 4e6, MAX_POINTS = 10000, DIGITS = 10;
const GPX = "http://www.topografix.com/GPX/1/1"; // a namespace, which is never asked for

/** @typedef {import("./plane_geometry.js").Point} Point @typedef {import("./mission_checks.js").Plan} Plan @typedef {import("./mission_checks.js").Leg} Leg */
/** @typedef {{latitude_deg: number, longitude_deg: number}} Origin */

const rad = (/** @type {number} */ degrees) => (degrees * Math.PI) / 180;

/** Metres per degree east and north. @param {number} latitudeDeg @returns {[number, number]} */
function metresPerDegree(latitudeDeg) {
  const w2 = 1 - ECCENTRICITY2 * Math.sin(rad(latitudeDeg)) ** 2, prime = SEMI_MAJOR_M / Math.sqrt(w2);
  return [rad(prime * Math.cos(rad(latitudeDeg))), rad((prime * (1 - ECCENTRICITY2)) / w2)];
}

/** Where the map's origin lies, from where a pose lies in both. @param {any} pose @returns {Origin} */
export function mapOrigin(pose) {
  const origin = { latitude_deg: pose.latitude_deg, longitude_deg: pose.longitude_deg };
  for (let round = 0; round < 3; round++) { // each takes out all but the curvature's change over the way to the origin
    const [latitude, longitude] = toGeodetic(pose, origin);
    origin.latitude_deg += pose.latitude_deg - latitude;
    origin.longitude_deg += pose.longitude_deg - longitude;
  }
  return origin;
}

/** Latitude and longitude. @param {Point} point @param {Origin} origin @returns {[number, number]} */
export function toGeodetic(point, origin) {
  const [east, north] = metresPerDegree(origin.latitude_deg);
  return [origin.latitude_deg + point.y_m / north, origin.longitude_deg + point.x_m / east];
}

/** @param {number} latitude @param {number} longitude @param {Origin} origin @returns {Point} */
export function toMap(latitude, longitude, origin) {
  if (!(Math.abs(latitude) <= 90 && Math.abs(longitude) <= 180)) throw new Error(FILE_TEXTS.noPlace);
  const [east, north] = metresPerDegree(origin.latitude_deg);
  return { x_m: (longitude - origin.longitude_deg) * east, y_m: (latitude - origin.latitude_deg) * north };
}

/** @param {Point[]} waypoints @param {Partial<Leg>} [more] @returns {Leg} */
export const leg = (waypoints, more = {}) => ({ kind: "follow_route", waypoints, repeat: false, laps: 1, radius_m: 0, duration_s: 0, speed_mps: 0, ...more });

/** The plan of a file. Throws an Error whose message says what is wrong with it. @param {string} name @param {string} text @param {Origin} origin @returns {Plan} */
export function readFile(name, text, origin) {
  if (text.length > MAX_BYTES) throw new Error(FILE_TEXTS.tooLarge(MAX_BYTES / 1e6));
  const plan = /\.gpx$/i.test(name) ? readGpx(text, origin) : readGeoJson(text, origin);
  const count = plan.legs.reduce((all, each) => all + each.waypoints.length, 0);
  if (count > MAX_POINTS) throw new Error(FILE_TEXTS.tooManyPoints(count, MAX_POINTS));
  if (!plan.legs.length && !plan.fence.length && !plan.rally.length) throw new Error(FILE_TEXTS.empty);
  return plan;
}

/** Routes, else tracks, else waypoints as one route. @param {string} text @param {Origin} origin @returns {Plan} */
function readGpx(text, origin) {
  if (text.includes("<!DOCTYPE")) throw new Error(FILE_TEXTS.doctype);
  const file = new DOMParser().parseFromString(text, "application/xml");
  if (file.querySelector("parsererror") || file.documentElement.localName !== "gpx") throw new Error(FILE_TEXTS.noGpx);
  const points = (/** @type {Element} */ parent, /** @type {string} */ element) =>
    [...parent.getElementsByTagNameNS("*", element)].map((each) => toMap(number(each.getAttribute("lat")), number(each.getAttribute("lon")), origin));
  for (const [line, element] of [["rte", "rtept"], ["trk", "trkpt"]]) {
    const lines = [...file.getElementsByTagNameNS("*", line)].map((each) => closed(leg(points(each, element)), each.getElementsByTagNameNS("*", "type")[0]?.textContent === "repeat"));
    if (lines.some((each) => each.waypoints.length)) return { legs: lines, fence: [], rally: [] };
  }
  const lone = points(file.documentElement, "wpt");
  return { legs: lone.length ? [leg(lone)] : [], fence: [], rally: [] };
}

/** @param {string | null} text */
function number(text) {
  if (text === null || text.trim() === "" || !Number.isFinite(Number(text))) throw new Error(FILE_TEXTS.noDegrees(String(text)));
  return Number(text);
}

/** A line that repeats ends in a file where it begins. @param {Leg} found @param {boolean} repeat */
function closed(found, repeat) {
  const { waypoints } = found, first = waypoints[0], last = waypoints.at(-1);
  if (!repeat) return found;
  const isRing = waypoints.length > 2 && first && last && Math.hypot(first.x_m - last.x_m, first.y_m - last.y_m) < 0.01;
  return { ...found, repeat, laps: 0, waypoints: isRing ? waypoints.slice(0, -1) : waypoints };
}

/** @param {string} text @param {Origin} origin @returns {Plan} */
function readGeoJson(text, origin) {
  const root = JSON.parse(text), features = root?.features ?? [root];
  if (!Array.isArray(features)) throw new Error(FILE_TEXTS.noGeoJson);
  /** @type {Plan} */
  const plan = { legs: [], fence: [], rally: [] };
  /** @type {Point[]} */
  const rally = [];
  const toPoint = (/** @type {any} */ at) => toMap(Number(at?.[1]), Number(at?.[0]), origin);
  for (const feature of features) {
    const geometry = feature?.geometry ?? feature, properties = feature?.properties ?? {}, more = properties.leg ?? {};
    if (geometry?.type === "LineString") plan.legs.push({ ...closed(leg(geometry.coordinates.map(toPoint)), properties.repeat === true), ...more });
    else if (geometry?.type === "Point" && properties.rally === true) rally.push(toPoint(geometry.coordinates));
    else if (geometry?.type === "Point") plan.legs.push(leg([toPoint(geometry.coordinates)], { kind: "hold_station", radius_m: 3, ...more }));
    else if (geometry?.type === "Polygon") plan.fence.push({ keep: properties.keep === "out" ? "out" : "in", corners: geometry.coordinates[0].slice(0, -1).map(toPoint) });
    else if (feature?.geometry === null && more.kind) plan.legs.push(leg([], more));
  }
  return { ...plan, rally: rallyOf(rally) };
}

/** Rally points as what is drawn at once; nothing where there are none. @param {Point[]} points @returns {Leg[]} */
export const rallyOf = (points) => (points.length ? [leg(points, { kind: "rally" })] : []);

/** Routes alone: GPX knows no fence and no station. @param {Plan} plan @param {Origin} origin */
export function writeGpx(plan, origin) {
  const file = document.implementation.createDocument(GPX, "gpx"), root = file.documentElement;
  root.setAttribute("version", "1.1");
  root.setAttribute("creator", "paani");
  for (const each of plan.legs) {
    if (each.kind !== "follow_route") continue;
    const route = root.appendChild(file.createElementNS(GPX, "rte"));
    if (each.repeat) route.appendChild(file.createElementNS(GPX, "type")).textContent = "repeat";
    for (const point of ring(each)) {
      const [latitude, longitude] = toGeodetic(point, origin), element = file.createElementNS(GPX, "rtept");
      element.setAttribute("lat", latitude.toFixed(DIGITS));
      element.setAttribute("lon", longitude.toFixed(DIGITS));
      route.appendChild(element);
    }
  }
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(file)}\n`;
}

/** @param {Leg} each */
const ring = ({ waypoints, repeat }) => (repeat ? [...waypoints, waypoints[0]] : waypoints);

/** @param {Plan} plan @param {Origin} origin */
export function writeGeoJson(plan, origin) {
  const position = (/** @type {Point} */ point) => toGeodetic(point, origin).reverse().map((degrees) => Number(degrees.toFixed(DIGITS)));
  const lines = plan.legs.map((each) => {
    const { waypoints, ...more } = each, points = ring(each).map(position);
    const geometry = !points.length ? null : points.length > 1 ? { type: "LineString", coordinates: points } : { type: "Point", coordinates: points[0] };
    return { type: "Feature", properties: { repeat: each.repeat, leg: more }, geometry };
  });
  const areas = plan.fence.map(({ keep, corners }) => ({
    type: "Feature", properties: { keep }, geometry: { type: "Polygon", coordinates: [[...corners, corners[0]].map(position)] },
  }));
  const rally = plan.rally.flatMap(({ waypoints }) => waypoints).map((point) => ({
    type: "Feature", properties: { rally: true }, geometry: { type: "Point", coordinates: position(point) },
  }));
  return `${JSON.stringify({ type: "FeatureCollection", features: [...lines, ...areas, ...rally] }, null, 1)}\n`;
}
