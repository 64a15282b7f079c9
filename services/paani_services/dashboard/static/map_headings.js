// @ts-check
// On demand, why the planner took one heading and not the others: a ray for each around the boat, in the colours of what
// refuses it at each speed, and the words of the one that is pointed at, tapped, or chosen by keys.

import { CELL_PX, INNER_PX, describeVerdict, findTaken, fromPort, nameVerdict, nearestTo, rayAt } from "./heading_verdicts.js";
import { CONSTRAINTS, HEADING_TEXTS, byId, make, setText } from "./text.js";

const DRAG_PX = 4;
/** @type {Record<string, string>} */
const COLOURS = {
  none: "--green", person: "--red", static_obstacle: "--orange", dynamic_obstacle: "--rose", unknown_water: "--blue-text",
  wait: "--cyan", look: "--route", no_escape: "--text", too_fast: "--amber", turn: "--grey",
};

/** @typedef {import("./heading_verdicts.js").Verdict} Verdict */

export class MapHeadings {
  /** @param {HTMLCanvasElement} canvas of the map @param {(event: MouseEvent) => [number, number]} pixelUnder what is drawn under the pointer */
  constructor(canvas, pixelUnder) {
    this.pixelUnder = pixelUnder;
    this.isOn = false;
    /** The heading somebody chose; null: whichever the planner takes. @type {number | null} */
    this.chosenRad = null;
    /** @type {number | null} */
    this.pointedRad = null;
    /** As drawn last: from port to starboard. @type {Verdict[]} */
    this.verdicts = [];
    /** @type {[number, number]} */
    this.boatPx = [0, 0];
    this.turnRad = 0;
    this.bindControls();
    this.bindPointer(canvas);
  }

  bindControls() {
    const button = byId("map-headings"), range = byId("heading-range");
    button.addEventListener("click", () => {
      this.isOn = !this.isOn;
      this.chosenRad = this.pointedRad = null;
      button.setAttribute("aria-pressed", String(this.isOn));
      byId("headings").hidden = !this.isOn;
    });
    range.addEventListener("input", () => { this.choose(this.verdicts[Number(range.value)]); });
    byId("heading-taken").addEventListener("click", () => { this.chosenRad = null; });
  }

  /** @param {HTMLCanvasElement} canvas */
  bindPointer(canvas) {
    let down = { x: 0, y: 0 };
    canvas.addEventListener("pointerdown", (event) => { down = { x: event.clientX, y: event.clientY }; });
    canvas.addEventListener("pointerleave", () => { this.pointedRad = null; });
    canvas.addEventListener("pointermove", (event) => { this.pointedRad = (event.buttons ? undefined : this.rayOf(event))?.heading_rad ?? null; });
    canvas.addEventListener("click", (event) => {
      if (Math.hypot(event.clientX - down.x, event.clientY - down.y) <= DRAG_PX) this.choose(this.rayOf(event));
    });
  }

  /** @param {MouseEvent} event */
  rayOf(event) {
    const [x, y] = this.pixelUnder(event);
    return rayAt(this.verdicts, x - this.boatPx[0], this.boatPx[1] - y, this.turnRad);
  }

  /** @param {Verdict | undefined} verdict */
  choose(verdict) {
    if (verdict) this.chosenRad = verdict.heading_rad;
  }

  /**
   * @param {import("./map_objects.js").Chart} chart @param {Verdict[]} verdicts @param {any} pose @param {boolean} isPlannerOn
   * @param {boolean} isDrawing whether a mission is being drawn, for which the map is needed
   */
  render(chart, verdicts, pose, isPlannerOn, isDrawing) {
    const isShown = this.isOn && !isDrawing;
    byId("headings").hidden = !isShown;
    this.verdicts = isShown && pose ? fromPort(verdicts) : [];
    if (!isShown) return;
    const taken = findTaken(this.verdicts), atRad = this.pointedRad ?? this.chosenRad;
    const chosen = !this.verdicts.length ? undefined : atRad === null ? taken ?? verdicts[0] : nearestTo(this.verdicts, atRad);
    this.renderWords(chosen, taken, isPlannerOn);
    if (!chosen) return;
    this.boatPx = chart.toScreen(pose.x_m, pose.y_m);
    this.turnRad = chart.turnRad;
    for (const verdict of this.verdicts) drawRay(chart, this.boatPx, verdict);
    if (taken) drawTip(chart, this.boatPx, taken, true);
    drawTip(chart, this.boatPx, chosen, false);
  }

  /** @param {Verdict | undefined} chosen @param {Verdict | undefined} taken @param {boolean} isPlannerOn */
  renderWords(chosen, taken, isPlannerOn) {
    const range = byId("heading-range");
    range.disabled = !chosen;
    byId("heading-taken").disabled = this.chosenRad === null;
    setText(byId("heading-words"), chosen ? describeVerdict(chosen, taken) : isPlannerOn ? HEADING_TEXTS.none : HEADING_TEXTS.off);
    const met = Object.keys(CONSTRAINTS).filter((name) => this.verdicts.some((each) => each.refused_by.includes(name))), legend = byId("heading-legend");
    if (legend.dataset.met !== met.join()) {
      legend.dataset.met = met.join();
      legend.replaceChildren(...met.map((name) => {
        const item = make("span"), sign = make("i");
        sign.style.background = `var(${COLOURS[name]})`;
        item.append(sign, CONSTRAINTS[name][0]);
        return item;
      }));
    }
    if (!chosen) return;
    range.max = String(this.verdicts.length - 1);
    range.value = String(this.verdicts.indexOf(chosen));
    range.setAttribute("aria-valuetext", nameVerdict(chosen, taken));
  }
}

/** A place on a ray. @param {[number, number]} boatPx @param {number} headingRad on the screen @param {number} farPx @returns {[number, number]} */
const along = ([x, y], headingRad, farPx) => [x + farPx * Math.cos(headingRad), y - farPx * Math.sin(headingRad)];

/** A length for each speed, the fastest outermost. @param {import("./map_objects.js").Chart} chart @param {[number, number]} boatPx @param {Verdict} verdict */
function drawRay({ ctx, turnRad, colour }, boatPx, { heading_rad: headingRad, refused_by: refusedBy }) {
  ctx.lineWidth = 4;
  refusedBy.forEach((name, index) => {
    const fromPx = INNER_PX + CELL_PX * (refusedBy.length - 1 - index);
    ctx.strokeStyle = colour(COLOURS[name] ?? "--grey");
    ctx.beginPath();
    ctx.moveTo(...along(boatPx, headingRad + turnRad, fromPx + 1));
    ctx.lineTo(...along(boatPx, headingRad + turnRad, fromPx + CELL_PX - 1));
    ctx.stroke();
  });
}

/** An arrow ahead of the ray that was taken, a ring ahead of the one that is told. @param {import("./map_objects.js").Chart} chart @param {[number, number]} boatPx @param {Verdict} verdict @param {boolean} isTaken */
function drawTip({ ctx, turnRad, colour }, boatPx, { heading_rad: headingRad, refused_by: refusedBy }, isTaken) {
  const endPx = INNER_PX + CELL_PX * refusedBy.length, rad = headingRad + turnRad;
  ctx.fillStyle = ctx.strokeStyle = colour("--text");
  ctx.lineWidth = 2;
  ctx.beginPath();
  if (isTaken) {
    ctx.moveTo(...along(boatPx, rad, endPx + 13));
    ctx.lineTo(...along(boatPx, rad + 0.09, endPx + 2));
    ctx.lineTo(...along(boatPx, rad - 0.09, endPx + 2));
    ctx.fill();
  } else {
    ctx.arc(...along(boatPx, rad, endPx + 20), 4, 0, 7);
    ctx.stroke();
  }
}
