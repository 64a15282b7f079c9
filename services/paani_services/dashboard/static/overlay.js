// @ts-check
// Draws the results of perception and advisor over the picture they belong to, in its normalised coordinates.

import { EXPLANATION_TEXTS, fixed, trackLabel } from "./text.js";

export const MASK_RGBA = [[23, 184, 214, 66], [242, 140, 30, 100], [36, 56, 143, 84]];
const ACCEPTED = "#ffb454", TENTATIVE = "#c9d3da", IMMEDIATE = "#ff4d52";
const BLOCKED = "#ff5a5f", CLEAR = "#57d69b", UNKNOWN = "#9fb0bb", OWN_HULL = "#ebf3f8";
const LABEL_HEIGHT_PX = 18, LABEL_PITCH_PX = 19;
const LANES = /** @type {const} */ (["left", "center", "right"]);

/**
 * A class mask as a tinted, transparent canvas.
 * @param {import("./picture_decoding.js").DecodedPicture} classes as grey levels: 0 water, 1 obstacle, 2 sky
 */
export function tintMask({ image, width, height }) {
  const canvas = new OffscreenCanvas(width, height);
  const context = /** @type {OffscreenCanvasRenderingContext2D} */ (canvas.getContext("2d", { willReadFrequently: true }));
  context.drawImage(image, 0, 0);
  const pixels = context.getImageData(0, 0, width, height);
  for (let i = 0; i < pixels.data.length; i += 4) {
    pixels.data.set(MASK_RGBA[pixels.data[i]] ?? [0, 0, 0, 0], i);
  }
  context.putImageData(pixels, 0, 0);
  return canvas;
}

/** @typedef {{ctx: CanvasRenderingContext2D, width: number, height: number, unit: number}} Pane */
/** @typedef {{left: number, top: number, width: number}} LabelPlace */

/** @param {Pane} pane @param {OffscreenCanvas} mask */
export function drawMask({ ctx, width, height }, mask) {
  ctx.imageSmoothingEnabled = true;
  ctx.drawImage(mask, 0, 0, width, height);
}

/** How wide a label is, and where it lies in the picture. @param {Pane} pane @param {string} text @param {number} x @param {number} share of the label that lies left of x @returns {LabelPlace} */
function placeLabel({ ctx, unit, width: paneWidth }, text, x, share = 0) {
  ctx.font = `600 ${12 * unit}px system-ui, sans-serif`;
  const width = ctx.measureText(text).width + 8 * unit;
  return { left: Math.min(Math.max(0, x - share * width), paneWidth - width), top: 0, width };
}

/** @param {Pane} pane @param {string} text @param {LabelPlace} place @param {string} colour */
function drawLabel({ ctx, unit }, text, { left, top, width }, colour) {
  const height = LABEL_HEIGHT_PX * unit;
  ctx.font = `600 ${12 * unit}px system-ui, sans-serif`;
  ctx.textBaseline = "middle";
  ctx.fillStyle = "rgb(8 11 14 / .78)";
  ctx.fillRect(left, top, width, height);
  ctx.fillStyle = colour;
  ctx.textAlign = "left";
  ctx.fillText(text, left + 4 * unit, top + height / 2 + unit);
}

/** On whole pixels, so that its lines are sharp. @param {Pane} pane @param {number[]} box @param {string} colour @param {number} lineWidth @param {number[]} dash */
function drawBox({ ctx, width, height, unit }, box, colour, lineWidth, dash) {
  const [x1, x2] = [box[0], box[2]].map((x) => Math.round(x * width)), [y1, y2] = [box[1], box[3]].map((y) => Math.round(y * height));
  ctx.setLineDash(dash.map((part) => part * unit));
  ctx.lineWidth = lineWidth * unit;
  ctx.strokeStyle = colour;
  ctx.strokeRect(x1, y1, x2 - x1, y2 - y1);
  ctx.setLineDash([]);
}

/** @param {Pane} pane @param {any} evidence @param {any} tracks of the same frame, or undefined */
export function drawBoxes(pane, evidence, tracks) {
  /** @type {[string, number[], string][]} */
  const labels = [];
  if (tracks) {
    for (const track of tracks.tracks) {
      const colour = track.immediate_danger ? IMMEDIATE : track.accepted ? ACCEPTED : TENTATIVE;
      if (track.held && !track.accepted) continue; // neither seen in this picture nor counted by the advisor
      drawBox(pane, track.box_xyxy, colour, track.immediate_danger ? 3 : 2, track.held ? [6, 4] : []);
      if (track.held) continue; // no label: the dashed box says enough, and labels would cover the picture
      labels.push([trackLabel(track), track.box_xyxy, colour]);
    }
  } else {
    for (const found of evidence.detections) {
      drawBox(pane, found.box_xyxy, TENTATIVE, 1.5, []);
      labels.push([`${found.label} ${fixed(found.confidence)}`, found.box_xyxy, TENTATIVE]);
    }
  }
  /** @type {LabelPlace[]} */
  const taken = [];
  for (const [text, box, colour] of labels) {
    const above = box[1] * pane.height - LABEL_PITCH_PX * pane.unit, below = box[1] * pane.height + 2 * pane.unit;
    const place = placeLabel(pane, text, box[0] * pane.width - pane.unit);
    place.top = freeTop(above, below, LABEL_PITCH_PX * pane.unit, place, taken);
    taken.push(place);
    if (place.top !== above && place.top !== below) drawLeader(pane, box, place.top, colour);
    drawLabel(pane, text, place, colour);
  }
}

/** From a box to its label, where others stand between them. @param {Pane} pane @param {number[]} box @param {number} labelTop @param {string} colour */
function drawLeader({ ctx, width, height, unit }, box, labelTop, colour) {
  const x = Math.round(box[0] * width);
  ctx.lineWidth = unit;
  ctx.strokeStyle = colour;
  ctx.beginPath();
  ctx.moveTo(x, box[1] * height);
  ctx.lineTo(x, labelTop + 0.5 * LABEL_HEIGHT_PX * unit);
  ctx.stroke();
}

/** Where a label hides none of those before it: above its box, else in it, else further up or down. @param {number} above @param {number} below @param {number} pitch @param {LabelPlace} place @param {LabelPlace[]} taken */
export function freeTop(above, below, pitch, { left, width }, taken) {
  const steps = taken.map((_, index) => (index + 1) * pitch);
  const tops = [above, below, ...steps.map((step) => above - step), ...steps.map((step) => below + step)].filter((top) => top >= 0);
  const isFree = (/** @type {number} */ top) =>
    taken.every((other) => Math.abs(other.top - top) >= pitch - 1 || other.left + other.width <= left || left + width <= other.left);
  return tops.find(isFree) ?? tops[0] ?? 0;
}

/** Corridor brackets along the bottom. @param {Pane} pane @param {any} corridors @param {any} advisory of the same frame, or undefined */
export function drawCorridors(pane, corridors, advisory) {
  const { ctx, width, height, unit } = pane, labels = corridorLabels(pane, corridors, advisory);
  for (const [index, name] of LANES.entries()) {
    const [from, to] = corridors[name];
    const lane = advisory?.[name];
    const colour = lane ? (lane.blocked ? BLOCKED : CLEAR) : UNKNOWN;
    const x1 = from * width, x2 = to * width, top = corridors.top * height;
    const base = height - (index === 1 ? 4 : 9) * unit;
    const fade = ctx.createLinearGradient(0, top, 0, height);
    fade.addColorStop(0, `${colour}00`);
    fade.addColorStop(1, `${colour}2a`);
    ctx.fillStyle = fade;
    ctx.fillRect(x1, top, x2 - x1, height - top);
    ctx.strokeStyle = colour;
    ctx.lineWidth = 3 * unit;
    ctx.beginPath();
    ctx.moveTo(x1, base - 12 * unit);
    ctx.lineTo(x1, base);
    ctx.lineTo(x2, base);
    ctx.lineTo(x2, base - 12 * unit);
    ctx.stroke();
    const [text, place] = labels[index];
    drawLabel(pane, text, { ...place, top: height - 33 * unit }, colour);
  }
}

/** What stands at each corridor, and where: in a small picture the risk alone, since its colour says the verdict. @param {Pane} pane @param {any} corridors @param {any} advisory @returns {[string, LabelPlace][]} */
function corridorLabels(pane, corridors, advisory) {
  const labelled = (/** @type {boolean} */ isWhole) => LANES.map((name) => {
    const lane = advisory?.[name], verdict = isWhole && lane ? ` ${EXPLANATION_TEXTS.verdicts[lane.blocked ? "blocked" : "clear"]}` : "";
    const text = lane ? fixed(lane.risk) + verdict : EXPLANATION_TEXTS.corridors[name].toLowerCase();
    return /** @type {[string, LabelPlace]} */ ([text, placeLabel(pane, text, ((corridors[name][0] + corridors[name][1]) / 2) * pane.width, 0.5)]);
  });
  const whole = labelled(true);
  return whole.some(([, place], index) => index && whole[index - 1][1].left + whole[index - 1][1].width > place.left) ? labelled(false) : whole;
}

/** The upper edge of the corridors. @param {Pane} pane @param {number} top */
export function drawCorridorTop({ ctx, width, height, unit }, top) {
  ctx.strokeStyle = "rgb(235 243 248 / .75)";
  ctx.lineWidth = unit;
  ctx.setLineDash([3 * unit, 5 * unit]);
  ctx.beginPath();
  ctx.moveTo(0, top * height);
  ctx.lineTo(width, top * height);
  ctx.stroke();
  ctx.setLineDash([]);
}

/** What the own hull covers of the picture, which is no evidence. @param {Pane} pane @param {[number, number][]} corners */
export function drawOwnHull({ ctx, width, height, unit }, corners) {
  ctx.beginPath();
  for (const [x, y] of corners) ctx.lineTo(x * width, y * height);
  ctx.closePath();
  ctx.fillStyle = "rgb(8 11 14 / .45)";
  ctx.fill();
  ctx.strokeStyle = OWN_HULL;
  ctx.lineWidth = 1.5 * unit;
  ctx.setLineDash([8 * unit, 3 * unit]);
  ctx.stroke();
  ctx.setLineDash([]);
}
