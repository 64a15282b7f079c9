// @ts-check
// The camera panel: recent pictures by frame id, and the overlay that belongs to the picture shown.

import { chooseFrame } from "./frame_matching.js";
import { drawBoxes, drawCorridors, drawCorridorTop, drawMask, drawOwnHull } from "./overlay.js";
import { CAMERA_TEXTS, ageText, byId, screenScale, setText, words } from "./text.js";

const OPACITY_KEY = "paani-overlay-opacity";
/** @type {{frame_seq: number | null, picture_seq: number | null, mask_seq: number | null, evidence_seq: number | null, advisory_seq: number | null}} */
const NOTHING = { frame_seq: null, picture_seq: null, mask_seq: null, evidence_seq: null, advisory_seq: null };

/** @type {[number, number][]} */
const NO_HULL = [];

export class Camera {
  /** @param {import("./view.js").View} view whose frames are shown */
  constructor(view) {
    this.view = view;
    this.canvas = /** @type {HTMLCanvasElement} */ (byId("camera"));
    this.ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { willReadFrequently: false }));
    this.layers = { mask: true, boxes: true, lanes: true, limit: true, hull: true };
    this.bindOpacity();
    /** Frame numbers of what the canvas shows now; tests read them. */
    this.overlay = { ...NOTHING };
    this.isDrawScheduled = false;
    /** What the canvas was drawn from. @type {any[]} */
    this.drawnFrom = [];
    this.widthPx = this.canvas.clientWidth;
    new ResizeObserver(() => {
      this.widthPx = this.canvas.clientWidth;
      this.scheduleDraw();
    }).observe(this.canvas);
    for (const button of document.querySelectorAll("[data-layer]")) {
      button.addEventListener("click", () => this.toggle(/** @type {HTMLElement} */ (button).dataset.layer ?? ""));
    }
  }

  /** @param {string} name */
  toggle(name) {
    this.layers[name] = !this.layers[name];
    document.querySelector(`[data-layer="${name}"]`)?.setAttribute("aria-pressed", String(this.layers[name]));
    this.scheduleDraw();
  }

  /** How much of the picture the overlays cover, kept in this browser. */
  bindOpacity() {
    const range = byId("camera-opacity");
    range.value = localStorage.getItem(OPACITY_KEY) ?? range.max;
    range.addEventListener("input", () => {
      localStorage.setItem(OPACITY_KEY, range.value);
      this.scheduleDraw();
    });
  }

  /** Show the frames of another view. @param {import("./view.js").View} view */
  show(view) {
    if (view === this.view) return;
    this.view = view;
    this.overlay = { ...NOTHING };
    this.scheduleDraw();
  }

  scheduleDraw() {
    if (this.isDrawScheduled) return;
    this.isDrawScheduled = true;
    requestAnimationFrame(() => {
      this.isDrawScheduled = false;
      this.draw(this.view.now());
    });
  }

  /** Whether anything is drawn over the picture that comes later than it. */
  get waitsForEvidence() {
    const { mask, boxes, lanes, limit } = this.layers;
    return (mask || boxes || lanes || limit) && Number(byId("camera-opacity").value) > 0;
  }

  /** @param {number} now */
  draw(now) {
    const { store, frames: { pictures, masks, messages } } = this.view, { layers } = this, evidenceOf = messages["perception/evidence"];
    const chosen = this.waitsForEvidence
      ? chooseFrame(pictures.ids(), (id) => evidenceOf.get(id) !== undefined, (id) => !layers.mask || masks.get(id) !== undefined)
      : chooseFrame(pictures.ids(), () => false, () => false);
    const shown = chosen.id === null ? undefined : pictures.get(chosen.id);
    if (chosen.id === null || !shown) {
      this.drawNothing();
      return;
    }
    const { picture, header } = shown, evidence = evidenceOf.get(chosen.id), mask = evidence && masks.get(chosen.id);
    const { corridors, own_hull: ownHull = NO_HULL } = store.get("dashboard/settings") ?? {};
    const tracks = messages["advisor/tracks"].get(chosen.id), advisory = messages["advisor/advisory"].get(chosen.id);
    const newest = store.isFresh("perception/evidence", now) ? store.get("perception/evidence") : undefined;
    this.updateCaption(now, header, this.waitsForEvidence ? evidence : newest);
    const pane = this.resizeCanvas(picture), opacity = Number(byId("camera-opacity").value) / 100;
    const from = [picture, evidence, mask, tracks, advisory, corridors, ownHull, opacity, pane.width, pane.height, ...Object.values(layers)];
    if (from.length === this.drawnFrom.length && from.every((part, index) => part === this.drawnFrom[index])) return;
    this.drawnFrom = from;
    pane.ctx.imageSmoothingQuality = "high";
    pane.ctx.drawImage(picture.image, 0, 0, pane.width, pane.height);
    byId("layer-hull").hidden = !ownHull.length;
    pane.ctx.globalAlpha = opacity;
    if (mask && layers.mask) drawMask(pane, mask);
    if (evidence && corridors && layers.limit) drawCorridorTop(pane, corridors.top);
    if (evidence && corridors && layers.lanes) drawCorridors(pane, corridors, advisory);
    if (evidence && layers.boxes) drawBoxes(pane, evidence, tracks);
    if (ownHull.length && layers.hull) drawOwnHull(pane, ownHull);
    pane.ctx.globalAlpha = 1;
    this.overlay = {
      frame_seq: header.frame_seq,
      picture_seq: header.frame_seq,
      mask_seq: mask ? header.frame_seq : null,
      evidence_seq: evidence ? evidence.frame_seq : null,
      advisory_seq: advisory ? advisory.frame_seq : null,
    };
  }

  /** No picture of this view: never another's. */
  drawNothing() {
    if (this.overlay.picture_seq === null && byId("camera-id").textContent === "") return;
    this.ctx.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.drawnFrom = [];
    this.overlay = { ...NOTHING };
    setText(byId("camera-id"), "");
    setText(byId("camera-note"), CAMERA_TEXTS.noneThen);
  }

  /** @param {number} now @param {any} header @param {any} evidence */
  updateCaption(now, header, evidence) {
    const ageS = this.view.store.ageS("camera/picture", now), fresh = this.view.store.isFresh("camera/picture", now);
    const newest = this.view.store.get("camera/picture");
    const behind = newest ? newest.frame_seq - header.frame_seq : 0;
    this.canvas.classList.toggle("stale", !fresh);
    setText(byId("camera-id"), behind > 0 ? `${header.frame_seq} ${CAMERA_TEXTS.of} ${newest.frame_seq}` : `${CAMERA_TEXTS.frame} ${header.frame_seq}`);
    setText(
      byId("camera-note"),
      !fresh ? (ageS > this.view.store.limitS("camera/picture") ? CAMERA_TEXTS.last(ageText(ageS)) : CAMERA_TEXTS.gaps)
        : !evidence ? CAMERA_TEXTS.noEvidence
        : !evidence.usable ? `${CAMERA_TEXTS.unusable}: ${words(evidence.cause)}` : "",
    );
  }

  /** Match the canvas to the panel and the picture. @param {import("./picture_decoding.js").DecodedPicture} picture @returns {import("./overlay.js").Pane} */
  resizeCanvas(picture) {
    const aspect = String(picture.width / picture.height);
    if (this.canvas.style.getPropertyValue("--aspect") !== aspect) {
      this.canvas.style.setProperty("--aspect", aspect);
      this.widthPx = this.canvas.clientWidth;
    }
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.round(this.widthPx * ratio), height = Math.round((width * picture.height) / picture.width);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.drawnFrom = [];
    }
    return { ctx: this.ctx, width, height, unit: ratio * screenScale() };
  }
}
