// @ts-check
// Where places of the map lie on its canvas, whichever way is up. Pure.

export const NORTH_RAD = Math.PI / 2;

/** @typedef {{x: number, y: number}} Place in metres east and north */

export class MapProjection {
  /**
   * @param {Place} centre the place in the middle of the canvas @param {number} pxPerM
   * @param {number} upRad direction that points up, counter-clockwise from east @param {number} width @param {number} height
   */
  constructor(centre, pxPerM, upRad, width, height) {
    this.centre = centre;
    this.pxPerM = pxPerM;
    this.width = width;
    this.height = height;
    /** By which every direction is turned, counter-clockwise. */
    this.turnRad = NORTH_RAD - upRad;
    this.cos = Math.cos(this.turnRad);
    this.sin = Math.sin(this.turnRad);
  }

  /** @param {number} x @param {number} y @returns {[number, number]} pixels from the upper left */
  toScreen(x, y) {
    const east = x - this.centre.x, north = y - this.centre.y;
    return [
      this.width / 2 + this.pxPerM * (east * this.cos - north * this.sin),
      this.height / 2 - this.pxPerM * (east * this.sin + north * this.cos),
    ];
  }

  /** @param {number} px from the left @param {number} py from the top @returns {Place} */
  toMap(px, py) {
    const right = (px - this.width / 2) / this.pxPerM, up = (this.height / 2 - py) / this.pxPerM;
    return { x: this.centre.x + right * this.cos + up * this.sin, y: this.centre.y - right * this.sin + up * this.cos };
  }

  /** The middle after the map was dragged by so many pixels. @param {number} dx @param {number} dy @returns {Place} */
  dragged(dx, dy) {
    return this.toMap(this.width / 2 - dx, this.height / 2 - dy);
  }

  /** The smallest rectangle of east and north that holds the canvas. */
  get extent() {
    const corners = [[0, 0], [this.width, 0], [0, this.height], [this.width, this.height]].map(([px, py]) => this.toMap(px, py));
    const xs = corners.map(({ x }) => x), ys = corners.map(({ y }) => y);
    return { west: Math.min(...xs), east: Math.max(...xs), south: Math.min(...ys), north: Math.max(...ys) };
  }
}

/**
 * The middle of a map that follows the boat: the boat itself or, where its bow is up, a place ahead of it, since more is
 * to be seen of what lies ahead. @param {{x_m: number, y_m: number}} pose @param {number} upRad @param {number} aheadM
 * @returns {Place}
 */
export const placeAhead = (pose, upRad, aheadM) => ({ x: pose.x_m + aheadM * Math.cos(upRad), y: pose.y_m + aheadM * Math.sin(upRad) });
