// @ts-check
// Draws a chart's tiles below the map, where the page's server has a folder of them and it is known where the map lies.

import { mapOrigin } from "./mission_files.js";
import { ask } from "./past_source.js";
import { MAP_TEXTS, byId, setText } from "./text.js";
import { chooseZoom, tilesBelow } from "./tile_grid.js";

const MAX_KEPT = 256, AGAIN_MS = 30000;

/** @typedef {{picture: ImageBitmap | null, problem: string, askedAt: number}} Kept picture: null while it loads, and where there is none */

export class MapTiles {
  constructor() {
    /** @type {number[]} */
    this.zooms = [];
    this.credit = "";
    /** By address, the oldest first. @type {Map<string, Kept>} */
    this.kept = new Map();
    void this.load();
  }

  async load() {
    try {
      ({ zooms: this.zooms, credit: this.credit } = await (await ask("/api/tiles")).json());
    } catch (error) {
      setText(byId("map-tiles"), String(error instanceof Error ? error.message : error));
    }
  }

  /**
   * @param {CanvasRenderingContext2D} ctx @param {import("./map_projection.js").MapProjection} projection @param {any} pose
   * @param {string} ground colour of the map @param {number} strength of the chart on it, in [0, 1]
   */
  render(ctx, projection, pose, ground, strength) {
    if (!this.zooms.length || !pose || (!pose.latitude_deg && !pose.longitude_deg)) return;
    const origin = mapOrigin(pose), zoom = chooseZoom(this.zooms, origin.latitude_deg, projection.pxPerM);
    const tiles = tilesBelow(projection.extent, origin, zoom), problems = new Set();
    let missing = 0;
    for (const tile of tiles) {
      const { picture, problem } = this.take(`/tiles/${zoom}/${tile.column}/${tile.row}`);
      if (problem) problems.add(problem);
      if (picture) drawTile(ctx, projection, tile, picture);
      else missing++;
    }
    ctx.globalAlpha = 1 - strength; // over all of them at once, so that no seam shows
    ctx.fillStyle = ground;
    ctx.fillRect(0, 0, projection.width, projection.height);
    ctx.globalAlpha = 1;
    const state = !tiles.length ? MAP_TEXTS.tooFar : missing === tiles.length ? MAP_TEXTS.noTiles : this.credit;
    setText(byId("map-tiles"), [...problems][0] ?? state);
  }

  /** What is kept of an address; asked for where nothing is. @param {string} path @returns {Kept} */
  take(path) {
    const found = this.kept.get(path), now = performance.now();
    if (found && (found.picture || now - found.askedAt < AGAIN_MS)) return found;
    /** @type {Kept} */
    const kept = { picture: null, problem: "", askedAt: now };
    this.kept.delete(path);
    this.kept.set(path, kept);
    while (this.kept.size > MAX_KEPT) this.kept.delete(/** @type {string} */ (this.kept.keys().next().value));
    void loadPicture(path).then((picture) => { kept.picture = picture; }, (error) => { kept.problem = String(error.message); });
    return kept;
  }
}

/** Null where there is no such tile; throws an error with the reason where it cannot be shown. @param {string} path */
async function loadPicture(path) {
  const answer = await ask(path);
  if (answer.status === 204) return null;
  return createImageBitmap(await answer.blob()).catch(() => { throw new Error(`${path}: ${MAP_TEXTS.damagedTile}`); });
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./map_projection.js").MapProjection} projection @param {import("./tile_grid.js").Tile} tile @param {ImageBitmap} picture */
function drawTile(ctx, projection, { corners }, picture) {
  const [origin, right, below] = corners.map(({ x_m: x, y_m: y }) => projection.toScreen(x, y)), { width, height } = picture;
  ctx.save();
  ctx.transform((right[0] - origin[0]) / width, (right[1] - origin[1]) / width, (below[0] - origin[0]) / height, (below[1] - origin[1]) / height, origin[0], origin[1]);
  ctx.drawImage(picture, 0, 0, width + 0.5, height + 0.5); // they overlap by half a pixel
  ctx.restore();
}
