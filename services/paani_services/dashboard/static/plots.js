// @ts-check
// Plots over time, drawn by uPlot: made when they are opened, and again for another palette or width.

import { PLOTS, byId, fixed, screenScale } from "./text.js";

const HEIGHT_PX = 132, WIDTH_PX = 220, GAP_S = 3; // a curve is broken where no sample came for so long

export class Plots {
  /** @param {(atUs: number) => void} onSeek a moment was chosen */
  constructor(onSeek) {
    this.onSeek = onSeek;
    /** @type {any[]} */
    this.plots = [];
    this.made = "";
    this.shown = "";
    this.shownS = /** @type {number | null} */ (null);
    byId("time-plots").addEventListener("click", () => this.toggle());
  }

  toggle() {
    const panel = byId("plots");
    panel.hidden = !panel.hidden;
    byId("time-plots").setAttribute("aria-pressed", String(!panel.hidden));
    document.body.dataset.plots = String(!panel.hidden);
    this.made = "";
  }

  /** @param {import("./series.js").Series} series @param {number | null} shownUs the moment shown; null: the present */
  render(series, shownUs) {
    const panel = byId("plots");
    if (panel.hidden) return;
    const made = `${document.documentElement.dataset.palette} ${panel.clientWidth}`, shown = `${series.version} ${series.startUs} ${shownUs}`;
    if (made === this.made && shown === this.shown) return;
    this.shownS = shownUs === null ? null : shownUs / 1e6;
    if (made !== this.made) this.make(panel);
    const times = series.columns.at_us.map((us) => us / 1e6);
    this.plots.forEach((plot, index) => plot.setData(breakAtGaps(times, PLOTS[index][1].map(([name]) => series.columns[name] ?? times.map(() => null)))));
    this.made = made;
    this.shown = shown;
  }

  /** @param {HTMLElement} panel */
  make(panel) {
    for (const plot of this.plots) plot.destroy();
    const css = getComputedStyle(document.documentElement), colour = (/** @type {string} */ name) => css.getPropertyValue(name).trim();
    const scale = screenScale(), columns = Math.max(1, Math.min(PLOTS.length, Math.floor(panel.clientWidth / (WIDTH_PX * scale))));
    const width = Math.floor((panel.clientWidth - 24 * scale) / columns - 8 * scale);
    const axis = { stroke: colour("--quiet"), grid: { stroke: colour("--line"), width: 1 }, ticks: { show: false }, font: `${12 * scale}px system-ui, sans-serif` };
    this.plots = PLOTS.map(([title, curves]) => {
      const series = curves.map(([, label, name]) => ({ label, stroke: colour(name), width: 1.5, points: { show: false }, value: (/** @type {any} */ _, /** @type {any} */ value) => (value === null ? "–" : fixed(value)) }));
      // @ts-ignore: uPlot is a script of its own, which the page loads before this one
      const plot = new uPlot({
        title, width, height: HEIGHT_PX * scale, series: [{}, ...series],
        axes: [{ ...axis, size: 24 * scale, space: 64 * scale, values: (/** @type {any} */ _, /** @type {number[]} */ marks) => marks.map((s) => new Date(s * 1000).toTimeString().slice(0, marks[1] - marks[0] < 60 ? 8 : 5)) }, { ...axis, size: 44 * scale, space: 26 * scale }],
        scales: { x: { time: true }, y: { range: withMargin } }, cursor: { sync: { key: "time" }, drag: { x: false, y: false } }, legend: { live: true },
        hooks: { draw: [(/** @type {any} */ drawn) => this.drawMoment(drawn, colour("--text"))] },
      }, [[], ...curves.map(() => [])], panel);
      plot.over.addEventListener("click", () => plot.cursor.left >= 0 && this.onSeek(plot.posToVal(plot.cursor.left, "x") * 1e6));
      return plot;
    });
  }

  /** A line at the moment shown. @param {any} plot @param {string} colour */
  drawMoment(plot, colour) {
    if (this.shownS === null) return;
    const x = plot.valToPos(this.shownS, "x", true), { top, height } = plot.bbox;
    plot.ctx.fillStyle = colour;
    plot.ctx.fillRect(Math.round(x) - 1, top, 2, height);
  }
}

/** The range of an axis: a constant has one too. @param {any} _ @param {number | null} low @param {number | null} high @returns {[number, number]} */
function withMargin(_, low, high) {
  const [least, most] = [low ?? 0, high ?? 0], margin = Math.max((most - least) * 0.08, Math.abs(most) * 0.05, 0.02);
  return [least - margin, most + margin];
}

/** The same curves, with nothing between samples that are far apart. @param {number[]} times @param {any[][]} curves */
export function breakAtGaps(times, curves) {
  /** @type {any[][]} */
  const broken = [[], ...curves.map(() => [])];
  times.forEach((time, index) => {
    if (index && time - times[index - 1] > GAP_S) {
      broken[0].push(times[index - 1] + GAP_S / 2);
      for (let curve = 1; curve < broken.length; curve++) broken[curve].push(null);
    }
    broken[0].push(time);
    curves.forEach((curve, at) => broken[at + 1].push(curve[index]));
  });
  return broken;
}
