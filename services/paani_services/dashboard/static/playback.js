// @ts-check
// Plays a drive of the past into a view: the last ten minutes, or a recording. Frames are fetched some seconds ahead;
// the moment shown never runs past what was fetched.

import { View } from "./view.js";

const LOOK_BACK_US = 3e6; // so far back lie the newest messages of a moment
const WINDOW_US = 12e6, AHEAD_US = 5e6, KEPT_US = 30e6;
const STEP_KEY = "advisor/advisory";

/** @typedef {{key: string, header: import("./frames.js").FrameHeader, body: Uint8Array, atUs: number}} PastFrame */
/**
 * @typedef {object} Source a drive of the past
 * @property {string} name of the recording; empty: the last ten minutes
 * @property {import("./series.js").Series} series
 * @property {boolean} isKeyframed each moment comes whole, once a second; else every message comes when it did
 * @property {(fromUs: number, toUs: number) => Promise<PastFrame[]>} fetch
 */

export class Playback {
  /** @param {() => void} onPicture called when a picture of the past can be drawn */
  constructor(onPicture) {
    this.onPicture = onPicture;
    /** @type {Source | null} */
    this.source = null;
    this.view = new View(() => this.clockMs());
    this.atUs = 0;
    this.playing = false;
    this.speed = 1;
    this.problem = "";
    this.reset();
  }

  reset() {
    /** @type {PastFrame[]} */
    this.buffer = [];
    this.next = 0; // the first frame of the buffer that the view has not been given
    this.fromUs = this.toUs = this.fedUs = 0;
    this.loading = 0;
    this.generation = (this.generation ?? 0) + 1;
  }

  /** @param {Source} source @param {number} atUs */
  open(source, atUs) {
    this.close();
    this.source = source;
    this.seek(atUs);
  }

  close() {
    this.source = null;
    this.playing = false;
    this.problem = "";
    this.view.clear();
    this.reset();
  }

  /** The clock of the view: of the keyframe shown, or of the moment played. */
  clockMs() {
    return (this.source?.isKeyframed ? this.fedUs : this.atUs) / 1000;
  }

  /** @param {number} atUs */
  seek(atUs) {
    if (!this.source) return;
    const { series } = this.source;
    this.atUs = Math.min(Math.max(atUs, series.startUs), series.endUs);
    const isLoaded = this.buffer.length > 0 && this.fromUs <= this.atUs - LOOK_BACK_US && this.atUs <= this.toUs;
    if (!isLoaded) this.reset();
    if (!isLoaded) void this.load(this.atUs - LOOK_BACK_US);
    else if (this.atUs < this.fedUs) this.rewind();
    this.feed();
  }

  /** Play or pause; at the end, from the beginning; where loading failed before anything was there, load again. */
  toggle() {
    if (!this.source) return;
    if (!this.playing && this.atUs >= this.source.series.endUs) this.seek(this.source.series.startUs);
    else if (!this.playing && !this.toUs && !this.loading) this.seek(this.atUs);
    this.playing = !this.playing;
  }

  /** To the next moment that was decided, or to the one before. @param {1 | -1} direction */
  step(direction) {
    if (!this.source) return;
    this.playing = false;
    const { series, isKeyframed } = this.source, moments = series.columns.at_us;
    const decided = isKeyframed ? [] : this.buffer.filter((frame) => frame.key === STEP_KEY).map((frame) => frame.atUs);
    const found = direction > 0 ? decided.find((us) => us > this.atUs) : decided.findLast((us) => us < this.atUs);
    const index = series.indexAt(this.atUs);
    const before = moments[index] < this.atUs ? moments[index] : moments[index - 1];
    this.seek(found ?? (direction > 0 ? moments[index + 1] : before) ?? this.atUs);
  }

  /** Advance by real time. @param {number} elapsedMs */
  tick(elapsedMs) {
    if (!this.source) return;
    if (this.playing) {
      const end = this.source.series.endUs;
      this.atUs = Math.min(this.atUs + elapsedMs * 1000 * this.speed, Math.max(this.toUs, this.atUs), end);
      if (this.atUs >= end) this.playing = false;
      if (!this.loading && this.toUs && this.toUs < end && this.toUs - this.atUs < AHEAD_US * Math.max(1, this.speed)) void this.load(this.toUs);
    }
    this.feed();
  }

  rewind() {
    this.view.clear();
    this.next = Math.max(0, this.buffer.findIndex((frame) => frame.atUs >= this.atUs - LOOK_BACK_US));
    this.fedUs = 0;
  }

  /** Give the view every frame until the moment shown. */
  feed() {
    if (!this.source) return;
    for (; this.next < this.buffer.length && this.buffer[this.next].atUs <= this.atUs; this.next++) {
      const { key, header, body, atUs } = this.buffer[this.next];
      if (this.source.isKeyframed && atUs !== this.fedUs) this.view.clear();
      this.fedUs = atUs;
      const { drawn } = this.view.put(key, header, body, atUs / 1000);
      void drawn.then(() => this.onPicture());
    }
    this.view.tracks = { "localization/odometry": this.source.series.trackUntil(this.atUs), "@truth/pose": [] };
  }

  /** @param {number} fromUs */
  async load(fromUs) {
    if (!this.source) return;
    const { generation } = this, toUs = Math.min(fromUs + WINDOW_US, this.source.series.endUs);
    this.loading++;
    /** @type {PastFrame[]} */
    let found = [];
    try {
      found = await this.source.fetch(Math.round(fromUs), Math.round(toUs));
      if (generation === this.generation) this.problem = "";
    } catch (error) {
      if (generation === this.generation) this.problem = String(error instanceof Error ? error.message : error);
    }
    if (generation !== this.generation) return;
    this.loading--;
    if (this.problem) {
      this.playing = false;
      return;
    }
    const newer = found.filter((frame) => frame.atUs > this.toUs || !this.toUs);
    if (!this.toUs) this.fromUs = fromUs;
    this.toUs = toUs;
    const kept = this.buffer.findIndex((frame) => frame.atUs >= this.atUs - KEPT_US);
    if (kept > 0 && kept <= this.next) {
      this.buffer.splice(0, kept);
      this.next -= kept;
      this.fromUs = this.buffer[0].atUs;
    }
    this.buffer.push(...newer);
    this.feed();
  }
}
