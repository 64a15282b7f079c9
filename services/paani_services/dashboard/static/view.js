// @ts-check
// What the panels show: the newest messages, the frames of the camera and the tracks of the map, at a moment. The page
// has one of the present, and one of the past while a moment of it is shown.

import { CameraFrames } from "./camera_frames.js";
import { decodeJson } from "./frames.js";
import { Store } from "./store.js";

const MAX_TRACK_POINTS = 4000, TRACK_STEP_M = 0.15;

export class View {
  /** @param {() => number} now milliseconds, by the clock of its store */
  constructor(now) {
    this.now = now;
    this.store = new Store();
    this.frames = new CameraFrames();
    /** Where the boat was, by topic. @type {Record<string, {x: number, y: number}[]>} */
    this.tracks = { "localization/odometry": [], "@truth/pose": [] };
  }

  /**
   * Take one frame of the server; returns its value, and whether the camera's picture may have changed in a promise.
   * @param {string} key @param {import("./frames.js").FrameHeader} header @param {Uint8Array} body @param {number} now
   */
  put(key, header, body, now) {
    const value = header.picture ?? decodeJson(body);
    this.store.put(key, value, header.age_ms, now, body.byteLength);
    if (key in this.tracks) this.addPose(key, value);
    return { value, drawn: this.frames.put(key, value, body).catch(() => undefined) }; // a damaged picture is not shown
  }

  /** @param {string} key @param {any} pose */
  addPose(key, pose) {
    const track = this.tracks[key], last = track.at(-1);
    if (last && Math.hypot(last.x - pose.x_m, last.y - pose.y_m) < TRACK_STEP_M) return;
    track.push({ x: pose.x_m, y: pose.y_m });
    if (track.length > MAX_TRACK_POINTS) track.splice(0, MAX_TRACK_POINTS / 4);
  }

  /** Forget everything, to show another moment. */
  clear() {
    this.store = new Store();
    this.frames.clear();
  }
}
