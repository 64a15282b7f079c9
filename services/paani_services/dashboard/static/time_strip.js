// @ts-check
// The strip under the page: advice, mode, alerts and latency over time. A press on it shows that moment everywhere.

import { TIME_TEXTS, byId, clockText, fixed, reasonText, setText, words } from "./text.js";
import { ADVICE } from "./topbar.js";

const SPAN_US = 600e6;
const ROWS = 4, GAP_PX = 2, FULL_LATENCY_MS = 1000;
const KIND_COLOURS = { go: "--green", turn: "--amber", stop: "--red", none: "--faint" };
/** @type {Record<string, string>} */
const MODE_COLOURS = { STOPPED: "--red", NOT_ARMED: "--faint", MANUAL: "--cyan", ROUTE: "--green", HOLD: "--route", RETURN: "--blue", IDLE: "--grey" };
const STEPS_US = { ArrowLeft: -1e6, ArrowRight: 1e6, PageUp: 10e6, PageDown: -10e6 };

export class TimeStrip {
  /** @param {(atUs: number) => void} onSeek a moment was chosen */
  constructor(onSeek) {
    this.canvas = /** @type {HTMLCanvasElement} */ (byId("time-strip"));
    this.ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    this.onSeek = onSeek;
    this.range = { fromUs: 0, toUs: 0 };
    /** @type {number | null} */
    this.hoverUs = null;
    this.drawn = "";
    this.bind();
  }

  bind() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.seekTo(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      this.hoverUs = this.momentAt(event);
      if (event.buttons) this.seekTo(event);
    });
    canvas.addEventListener("pointerleave", () => { this.hoverUs = null; });
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in STEPS_US) && event.key !== "Home" && event.key !== "End") return;
      event.preventDefault();
      const { fromUs, toUs } = this.range, shownUs = this.shownUs ?? toUs;
      this.onSeek(event.key === "Home" ? fromUs : event.key === "End" ? toUs : shownUs + STEPS_US[/** @type {keyof typeof STEPS_US} */ (event.key)]);
    });
  }

  /** @param {PointerEvent} event */
  momentAt(event) {
    const box = this.canvas.getBoundingClientRect(), { fromUs, toUs } = this.range;
    return fromUs + Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)) * (toUs - fromUs);
  }

  /** @param {PointerEvent} event */
  seekTo(event) {
    if (this.range.toUs) this.onSeek(this.momentAt(event));
  }

  /** @param {import("./series.js").Series} series @param {number | null} shownUs the moment shown; null: the present */
  render(series, shownUs) {
    this.shownUs = shownUs;
    const isLive = series.maxSamples !== Infinity;
    this.range = { fromUs: isLive ? series.endUs - SPAN_US : series.startUs, toUs: series.endUs };
    const { canvas } = this, ratio = Math.min(devicePixelRatio || 1, 2), width = canvas.clientWidth, height = canvas.clientHeight;
    const palette = document.documentElement.dataset.palette ?? "";
    const key = [series.version, series.startUs, shownUs, width, height, palette].join();
    this.describe(series, this.hoverUs ?? shownUs ?? series.endUs);
    if (!width || key === this.drawn) return;
    this.drawn = key;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    this.ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.draw(series, shownUs, width, height);
    canvas.setAttribute("aria-valuemax", String(Math.round((this.range.toUs - this.range.fromUs) / 1e6)));
    canvas.setAttribute("aria-valuenow", String(Math.round(((shownUs ?? this.range.toUs) - this.range.fromUs) / 1e6)));
    canvas.setAttribute("aria-valuetext", series.length ? clockText(shownUs ?? series.endUs) : TIME_TEXTS.nothing);
  }

  /** @param {import("./series.js").Series} series @param {number | null} shownUs @param {number} width @param {number} height */
  draw(series, shownUs, width, height) {
    const { ctx } = this, { fromUs, toUs } = this.range, css = getComputedStyle(document.documentElement);
    const colour = (/** @type {string} */ name) => css.getPropertyValue(name).trim();
    const x = (/** @type {number} */ us) => ((us - fromUs) / Math.max(1, toUs - fromUs)) * width;
    const rowPx = (height - GAP_PX * (ROWS - 1)) / ROWS, top = (/** @type {number} */ row) => row * (rowPx + GAP_PX);
    ctx.clearRect(0, 0, width, height);
    ctx.fillStyle = colour("--raised");
    for (let row = 0; row < ROWS; row++) ctx.fillRect(0, top(row), width, rowPx);
    const { at_us: moments, advice = [], mode = [], latency_ms: latencies = [] } = series.columns;
    moments.forEach((us, index) => {
      const left = x(us), right = Math.max(left + 1, x(Math.min(moments[index + 1] ?? us + 1e6, us + 2e6)));
      const bar = (/** @type {number} */ row, /** @type {string} */ name, part = 1) => {
        ctx.fillStyle = colour(name);
        ctx.fillRect(left, top(row) + rowPx * (1 - part), right - left + 0.5, rowPx * part);
      };
      if (advice[index]) bar(0, KIND_COLOURS[/** @type {keyof typeof KIND_COLOURS} */ (ADVICE[advice[index]]?.[1] ?? "none")]);
      if (mode[index]) bar(1, MODE_COLOURS[mode[index]] ?? "--grey");
      if (latencies[index] !== null) bar(3, "--cyan", Math.min(1, latencies[index] / FULL_LATENCY_MS));
    });
    for (const event of series.events) {
      if (event.level === "info") continue;
      ctx.fillStyle = colour(event.level === "stop" ? "--red" : "--amber");
      ctx.fillRect(x(event.at_us) - 1, top(2), 3, rowPx);
    }
    if (shownUs === null) return;
    ctx.fillStyle = colour("--text");
    ctx.fillRect(x(shownUs) - 1, 0, 2, height);
  }

  /** What the series says of a moment. @param {import("./series.js").Series} series @param {number} atUs */
  describe(series, atUs) {
    const index = series.indexAt(atUs);
    if (index < 0) {
      setText(byId("time-readout"), TIME_TEXTS.nothing);
      return;
    }
    const value = (/** @type {string} */ name) => series.columns[name]?.[index] ?? null;
    const event = series.events.findLast((each) => each.level !== "info" && Math.abs(each.at_us - atUs) < 4e6);
    setText(byId("time-readout"), [
      clockText(atUs),
      value("advice") ? reasonText(value("advice")) : TIME_TEXTS.noAdvice,
      value("mode") ? words(value("mode")) : TIME_TEXTS.noMode,
      value("latency_ms") === null ? "" : `${fixed(value("latency_ms"), 0)} ms`,
      event?.text ?? "",
    ].filter(Boolean).join(" · "));
  }
}
