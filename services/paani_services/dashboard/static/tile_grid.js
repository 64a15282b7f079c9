// @ts-check
// Which tiles of a chart in Web Mercator lie below the map, and where their corners are. Pure.

import { toGeodetic, toMap } from "./mission_files.js";

const TILE_PX = 256, EQUATOR_M = 2 * Math.PI * 6378137;
const COARSEST = 1.5; // so much larger than drawn may a pixel of a tile be, before the next zoom level is taken
export const MAX_TILES = 64; // of one map; where more would be needed none is drawn

/** @typedef {{latitude_deg: number, longitude_deg: number}} Origin */
/** @typedef {{zoom: number, column: number, row: number, corners: import("./plane_geometry.js").Point[]}} Tile corners: north-west, north-east, south-west */

/** Column and row at a place, with fractions. @param {number} latitude @param {number} longitude @param {number} zoom @returns {[number, number]} */
export function tileAt(latitude, longitude, zoom) {
  const rad = (latitude * Math.PI) / 180;
  return [((longitude + 180) / 360) * 2 ** zoom, ((1 - Math.asinh(Math.tan(rad)) / Math.PI) / 2) * 2 ** zoom];
}

/** Latitude and longitude of a tile's upper left corner. @param {number} column @param {number} row @param {number} zoom @returns {[number, number]} */
export const cornerOf = (column, row, zoom) => [(Math.atan(Math.sinh(Math.PI * (1 - (2 * row) / 2 ** zoom))) * 180) / Math.PI, (column / 2 ** zoom) * 360 - 180];

/** The coarsest of the zoom levels whose pixels are fine enough, else the finest there is. @param {number[]} zooms ascending @param {number} latitude @param {number} pxPerM */
export function chooseZoom(zooms, latitude, pxPerM) {
  const metresPerPx = (/** @type {number} */ zoom) => (EQUATOR_M * Math.cos((latitude * Math.PI) / 180)) / (TILE_PX * 2 ** zoom);
  return zooms.find((zoom) => metresPerPx(zoom) * pxPerM <= COARSEST) ?? zooms[zooms.length - 1];
}

/**
 * The tiles below a part of the map; none where there would be too many.
 * @param {{west: number, east: number, south: number, north: number}} extent in metres @param {Origin} origin @param {number} zoom @returns {Tile[]}
 */
export function tilesBelow({ west, east, south, north }, origin, zoom) {
  const last = 2 ** zoom - 1, [column0, row0] = tileAt(...toGeodetic({ x_m: west, y_m: north }, origin), zoom), [column1, row1] = tileAt(...toGeodetic({ x_m: east, y_m: south }, origin), zoom);
  const [left, top, right, bottom] = [Math.max(0, Math.floor(column0)), Math.max(0, Math.floor(row0)), Math.min(last, Math.floor(column1)), Math.min(last, Math.floor(row1))];
  if (!((right - left + 1) * (bottom - top + 1) <= MAX_TILES)) return [];
  const tiles = [];
  for (let row = top; row <= bottom; row++) {
    for (let column = left; column <= right; column++) {
      const corners = [[column, row], [column + 1, row], [column, row + 1]].map(([x, y]) => toMap(...cornerOf(x, y, zoom), origin));
      tiles.push({ zoom, column, row, corners });
    }
  }
  return tiles;
}
