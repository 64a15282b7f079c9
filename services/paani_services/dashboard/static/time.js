// @ts-check
// Time on the page: the present, or a moment of the past, which is shown everywhere, read-only, until one press returns.

import { describeActivity } from "./activity.js";
import { showLogOf } from "./log.js";
import { historySource, loadHistory, replayedSource } from "./past_source.js";
import { Playback } from "./playback.js";
import { Plots } from "./plots.js";
import { TIME_TEXTS, ageText, agoText, byId, clockText, setText, spanText } from "./text.js";
import { TimeStrip } from "./time_strip.js";

export class Time {
  /** @param {import("./view.js").View} live @param {() => void} onPicture a picture of the past can be drawn */
  constructor(live, onPicture) {
    this.live = live;
    this.history = historySource();
    this.playback = new Playback(onPicture);
    this.strip = new TimeStrip((atUs) => this.seek(atUs));
    this.plots = new Plots((atUs) => this.seek(atUs));
    /** What is played instead of the present. @type {import("./playback.js").Source | null} */
    this.replayed = null;
    this.renderedAt = performance.now();
    byId("past-live-button").addEventListener("click", () => this.goLive());
    byId("time-back").addEventListener("click", () => this.step(-1));
    byId("time-next").addEventListener("click", () => this.step(1));
    byId("time-play").addEventListener("click", () => this.playback.toggle());
    byId("time-speed").addEventListener("change", () => { this.playback.speed = Number(byId("time-speed").value); });
    addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      if (event.key === "l") this.goLive();
      if (event.key === "k") this.playback.toggle();
      if (this.isPast && (event.key === "," || event.key === ".")) this.step(event.key === "," ? -1 : 1);
    });
  }

  /** What the panels show. */
  get view() {
    return this.playback.source ? this.playback.view : this.live;
  }

  get isPast() {
    return this.playback.source !== null;
  }

  /** The connection is there, perhaps again. */
  async reload() {
    await loadHistory(this.history.series).catch(() => undefined); // shown as a gap until the next time
  }

  /** @param {number} atUs */
  seek(atUs) {
    if (this.playback.source) this.playback.seek(atUs);
    else if (this.history.series.length) this.open(this.history, atUs);
  }

  /** @param {import("./playback.js").Source} source @param {number} atUs */
  open(source, atUs) {
    this.playback.open(source, atUs);
    this.playback.speed = Number(byId("time-speed").value);
  }

  /** @param {1 | -1} direction */
  step(direction) {
    if (!this.playback.source) this.seek(this.history.series.endUs);
    else this.playback.step(direction);
  }

  /** To the present; a page that replays a recording has none, and returns to that. */
  goLive() {
    if (!this.replayed) this.playback.close();
    else if (this.playback.source !== this.replayed) this.open(this.replayed, this.replayed.series.startUs);
  }

  /** Play a recording instead of the present. @param {string} name @param {number} fromS since its start */
  async replay(name, fromS) {
    const source = this.replayed = await replayedSource(name);
    this.open(source, source.series.startUs + fromS * 1e6);
    this.playback.playing = true;
  }

  /** @param {number} now */
  render(now) {
    this.playback.tick(now - this.renderedAt);
    this.renderedAt = now;
    const { source, atUs } = this.playback, series = (source ?? this.history).series;
    document.body.dataset.past = !source ? "" : source.name ? "recording" : "history";
    this.strip.render(series, source ? atUs : null);
    this.plots.render(series, source ? atUs : null);
    showLogOf(source ? series.events.filter((event) => event.at_us <= atUs) : null);
    this.renderControls();
    byId("past").hidden = !source;
    if (source) this.renderBanner(source, series, now);
  }

  renderControls() {
    const { source, playing } = this.playback, play = byId("time-play");
    play.disabled = byId("time-next").disabled = !source;
    byId("time-back").disabled = !source && !this.history.series.length;
    setText(play, playing ? "❚❚" : "▶");
    play.setAttribute("aria-label", playing ? TIME_TEXTS.pause : TIME_TEXTS.play);
  }

  /** @param {import("./playback.js").Source} source @param {import("./series.js").Series} series @param {number} now */
  renderBanner(source, series, now) {
    const { atUs, problem, buffer } = this.playback;
    setText(byId("past-word"), source.name ? TIME_TEXTS.recording : TIME_TEXTS.past);
    const place = source.name ? TIME_TEXTS.place(source.name, spanText(atUs - series.startUs), spanText(series.endUs - series.startUs)) : agoText(ageText((this.history.series.endUs - atUs) / 1e6));
    const state = problem || (buffer.length ? TIME_TEXTS.readOnly : TIME_TEXTS.loading);
    setText(byId("past-what"), `${clockText(atUs)}, ${place}: ${state}`);
    const button = byId("past-live-button");
    button.hidden = source === this.replayed;
    setText(button, this.replayed ? TIME_TEXTS.toReplayed : TIME_TEXTS.toLive);
    setText(byId("past-live"), this.replayed ? TIME_TEXTS.noBoat : `${TIME_TEXTS.liveNow}: ${describeActivity(this.live.store, now).word}. ${TIME_TEXTS.stillLive}`);
  }
}

/** Whether a key goes into a field. @param {EventTarget | null} target */
export const isTyping = (target) => target instanceof HTMLElement && target.matches("input:not([type=range]), select, textarea");

