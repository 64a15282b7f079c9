// @ts-check
// What the map shows and which way is up: the buttons, and what was chosen, kept in this browser.

import { NORTH_RAD } from "./map_projection.js";
import { MAP_TEXTS, byId, setText } from "./text.js";

const KEY = "paani-map";

/** What was chosen before; what is not there or damaged is as the page begins. */
function readChoice() {
  let kept = null;
  try {
    kept = JSON.parse(localStorage.getItem(KEY) ?? "null");
  } catch {
    kept = null;
  }
  return { isBoatUp: kept?.isBoatUp === true, follow: kept?.follow !== false };
}

export class MapControls {
  /** @param {(factor: number) => void} zoom @param {() => void} fit */
  constructor(zoom, fit) {
    const { isBoatUp, follow } = readChoice();
    this.isBoatUp = isBoatUp;
    /** A map that was moved by hand follows again when the page is loaded anew. */
    this.follow = this.keptFollow = follow;
    byId("map-follow").addEventListener("click", () => {
      this.setFollow(!this.follow);
      this.keptFollow = this.follow;
      this.keep();
    });
    byId("map-up").addEventListener("click", () => { this.isBoatUp = !this.isBoatUp; this.keep(); });
    byId("map-in").addEventListener("click", () => zoom(1.4));
    byId("map-out").addEventListener("click", () => zoom(1 / 1.4));
    byId("map-fit").addEventListener("click", fit);
    this.setFollow(follow);
  }

  keep() {
    localStorage.setItem(KEY, JSON.stringify({ isBoatUp: this.isBoatUp, follow: this.keptFollow }));
  }

  /** @param {boolean} follow */
  setFollow(follow) {
    this.follow = follow;
    byId("map-follow").setAttribute("aria-pressed", String(follow));
  }

  /** The direction that points up: north while one draws, or nobody knows where the bow is. @param {{yaw_rad: number} | undefined} pose @param {boolean} isDrawing */
  upRad(pose, isDrawing) {
    return this.isBoatUp && pose && !isDrawing ? pose.yaw_rad : NORTH_RAD;
  }

  /** @param {number} turnRad by which the map is turned, counter-clockwise @param {boolean} isDrawing */
  render(turnRad, isDrawing) {
    const button = byId("map-up"), degrees = (-turnRad * 180) / Math.PI;
    byId("map-needle").setAttribute("transform", `rotate(${degrees.toFixed(1)} 12 12)`);
    setText(byId("map-up-name"), MAP_TEXTS.up[this.isBoatUp && !isDrawing ? "boat" : "north"]);
    button.disabled = isDrawing;
    button.title = isDrawing ? MAP_TEXTS.drawing : MAP_TEXTS.turn;
  }
}
