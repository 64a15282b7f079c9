// @ts-check
// The camera panel: recent pictures by frame id, and the overlay that belongs to the picture shown.

import { FrameRing, chooseFrame, frameId } from "./frame_matching.js";
import { drawBoxes, drawCorridors, drawCorridorTop, drawMask, tintMask } from "./overlay.js";
import { ageText, byId, setText, words } from "./text.js";

export class Camera {
  /** @param {import("./store.js").Store} store */
  constructor(store) {
    this.store = store;
    this.canvas = /** @type {HTMLCanvasElement} */ (byId("camera"));
    this.ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { willReadFrequently: false }));
    /** @type {FrameRing<{bitmap: ImageBitmap, header: any}>} */
    this.pictures = new FrameRing((dropped) => dropped.bitmap.close());
    /** @type {FrameRing<OffscreenCanvas>} */
    this.masks = new FrameRing();
    /** @type {Record<string, FrameRing<any>>} */
    this.messages = { "perception/evidence": new FrameRing(), "advisor/tracks": new FrameRing(), "advisor/advisory": new FrameRing() };
    this.layers = { mask: true, boxes: true, lanes: true, limit: true };
    /** Frame numbers of what the canvas shows now; tests read them. */
    this.overlay = { frame_seq: null, picture_seq: null, mask_seq: null, evidence_seq: null };
    this.isDrawScheduled = false;
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

  /** @param {any} header @param {Uint8Array} body */
  async addPicture(header, body) {
    const bitmap = await createImageBitmap(new Blob([/** @type {BlobPart} */ (body)], { type: header.media_type }));
    this.pictures.put(frameId(header), { bitmap, header });
    this.scheduleDraw();
  }

  /** @param {any} header @param {Uint8Array} body */
  async addMask(header, body) {
    const blob = new Blob([/** @type {BlobPart} */ (body)], { type: header.media_type });
    const bitmap = await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    this.masks.put(frameId(header), tintMask(bitmap));
    bitmap.close();
    this.scheduleDraw();
  }

  /** @param {string} key @param {any} message */
  addMessage(key, message) {
    this.messages[key]?.put(frameId(message), message);
    this.scheduleDraw();
  }

  scheduleDraw() {
    if (this.isDrawScheduled) return;
    this.isDrawScheduled = true;
    requestAnimationFrame(() => {
      this.isDrawScheduled = false;
      this.draw(performance.now());
    });
  }

  /** @param {number} now */
  draw(now) {
    const evidenceOf = this.messages["perception/evidence"];
    const chosen = chooseFrame(this.pictures.ids(), (id) => evidenceOf.get(id) !== undefined, (id) => this.masks.get(id) !== undefined);
    if (chosen.id === null) return;
    const shown = this.pictures.get(chosen.id);
    if (!shown) return;
    const { bitmap, header } = shown;
    const evidence = chosen.evidence ? evidenceOf.get(chosen.id) : undefined;
    const mask = chosen.mask ? this.masks.get(chosen.id) : undefined;
    const pane = this.resizeCanvas(bitmap);
    pane.ctx.imageSmoothingQuality = "high";
    pane.ctx.drawImage(bitmap, 0, 0, pane.width, pane.height);
    const corridors = this.store.get("dashboard/settings")?.corridors;
    if (mask && this.layers.mask) drawMask(pane, mask);
    if (evidence && corridors && this.layers.limit) drawCorridorTop(pane, corridors.top);
    if (evidence && corridors && this.layers.lanes) drawCorridors(pane, corridors, this.messages["advisor/advisory"].get(chosen.id));
    if (evidence && this.layers.boxes) drawBoxes(pane, evidence, this.messages["advisor/tracks"].get(chosen.id));
    this.overlay = {
      frame_seq: header.frame_seq,
      picture_seq: header.frame_seq,
      mask_seq: mask ? header.frame_seq : null,
      evidence_seq: evidence ? evidence.frame_seq : null,
    };
    this.updateCaption(now, header, evidence);
  }

  /** @param {number} now @param {any} header @param {any} evidence */
  updateCaption(now, header, evidence) {
    const ageS = this.store.ageS("camera/picture", now), fresh = this.store.isFresh("camera/picture", now);
    const newest = this.store.get("camera/picture");
    const behind = newest ? newest.frame_seq - header.frame_seq : 0;
    this.canvas.classList.toggle("stale", !fresh);
    setText(byId("camera-id"), `frame ${header.frame_seq}${behind > 0 ? ` of ${newest.frame_seq}` : ""}, ${header.width_px} × ${header.height_px}`);
    setText(
      byId("camera-note"),
      !fresh ? (ageS > this.store.limitS("camera/picture") ? `Last picture ${ageText(ageS)} ago` : "Pictures come with gaps")
        : !evidence ? "No evidence for this frame: overlay left out"
        : !evidence.usable ? `Picture unusable: ${words(evidence.cause)}` : "",
    );
  }

  /** Match the canvas to the panel and the picture. @param {ImageBitmap} bitmap @returns {import("./overlay.js").Pane} */
  resizeCanvas(bitmap) {
    this.canvas.style.aspectRatio = `${bitmap.width} / ${bitmap.height}`;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.round(this.canvas.clientWidth * ratio), height = Math.round((width * bitmap.height) / bitmap.width);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    return { ctx: this.ctx, width, height, unit: ratio };
  }
}
