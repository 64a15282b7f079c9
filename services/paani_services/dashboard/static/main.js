// @ts-check
// Wires the socket to the store and the panels.

import { Camera } from "./camera.js";
import { decodeJson } from "./frames.js";
import { renderHealth } from "./health.js";
import { addLine, noteAdvice } from "./log.js";
import { ChartMap } from "./map.js";
import { renderMotion } from "./motion.js";
import { connect } from "./socket.js";
import { bindOrders, renderOrders, renewToken } from "./stop.js";
import { Store } from "./store.js";
import { renderTopbar } from "./topbar.js";
import { renderTuning } from "./tuning.js";
import { buildWhy, renderWhy } from "./why.js";

const FRAME_MS = 100;
const LAYERS = ["mask", "boxes", "lanes", "limit"];
const store = new Store();
const camera = new Camera(store);
const map = new ChartMap();
let open = false, opened = 0;

/** @param {string} key @param {import("./frames.js").FrameHeader} header @param {Uint8Array} body */
function take(key, header, body) {
  const now = performance.now();
  if (header.picture) {
    store.put(key, header.picture, header.age_ms, now);
    if (key === "camera/picture") void camera.takePicture(header.picture, body);
    if (key === "perception/mask") void camera.takeMask(header.picture, body);
    return;
  }
  const value = decodeJson(body);
  if (key === "dashboard/event") {
    addLine(value);
    return;
  }
  store.put(key, value, header.age_ms, now);
  if (key in camera.said) camera.take(key, value);
  if (key in map.trails) map.take(key, value);
  if (key === "advisor/advisory") noteAdvice(value);
}

/** @param {boolean} isOpen */
function onOpen(isOpen) {
  open = isOpen;
  if (isOpen && opened++ > 0) {
    document.querySelector("#log")?.replaceChildren();
    void renewToken();
  }
}

function render() {
  const now = performance.now();
  renderTopbar(store, open, now);
  renderOrders(store, open, now);
  if (document.hidden) return;
  renderTuning(store, now);
  renderWhy(store, now);
  renderMotion(store, now);
  renderHealth(store, open, now);
  map.render(store, now);
  if (!store.isFresh("camera/picture", now)) camera.drawSoon();
}

addEventListener("keydown", (event) => {
  const layer = LAYERS[Number(event.key) - 1];
  if (layer && !event.ctrlKey && !event.metaKey && !event.altKey) camera.toggle(layer);
});
buildWhy();
bindOrders();
connect(take, onOpen);
setInterval(render, FRAME_MS);
Object.defineProperty(window, "paani", {
  value: Object.freeze({
    get overlay() { return camera.overlay; },
    get link() { return document.body.dataset.link; },
  }),
});
