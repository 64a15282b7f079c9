// @ts-check
// Connects the WebSocket to the store and the panels.

import { alertOf, alertOfLink, bindAlerts } from "./alerts.js";
import { Camera } from "./camera.js";
import { bindDrive, isDriving, renderDrive } from "./drive.js";
import { buildExplanation, renderExplanation } from "./explanation.js";
import { decodeJson } from "./frames.js";
import { renderHealth } from "./health.js";
import { renderIndicator } from "./indicator.js";
import { bindLink } from "./link.js";
import { addLine, logAdvice } from "./log.js";
import { MapPanel } from "./map.js";
import { renderMotion } from "./motion.js";
import { bindOperatorControls, renderOperatorState } from "./operator.js";
import { bindPalette, nextPalette } from "./palette.js";
import { requireSession } from "./requests.js";
import { renderSensors } from "./sensors.js";
import { connect } from "./socket.js";
import { renderStages } from "./stages.js";
import { Store } from "./store.js";
import { renderTopbar } from "./topbar.js";
import { renderTuning } from "./tuning.js";

const RENDER_PERIOD_MS = 100;
const LAYERS = ["mask", "boxes", "lanes", "limit"];
const store = new Store();
const camera = new Camera(store);
const map = new MapPanel();
let open = false, opened = 0;

/** @param {string} key @param {import("./frames.js").FrameHeader} header @param {Uint8Array} body */
function onMessage(key, header, body) {
  const now = performance.now();
  if (header.picture) {
    store.put(key, header.picture, header.age_ms, now);
    if (key === "camera/picture") void camera.addPicture(header.picture, body);
    if (key === "perception/mask") void camera.addMask(header.picture, body);
    return;
  }
  const value = decodeJson(body);
  if (key === "dashboard/event") {
    addLine(value);
    alertOf(value.level, header.age_ms);
    return;
  }
  store.put(key, value, header.age_ms, now);
  if (key in camera.messages) camera.addMessage(key, value);
  if (key in map.tracks) map.addPose(key, value);
  if (key === "advisor/advisory") logAdvice(value);
}

/** @param {boolean} isOpen */
function onOpen(isOpen) {
  open = isOpen;
  void requireSession();
  if (isOpen && opened++ > 0) document.querySelector("#log")?.replaceChildren();
}

function render() {
  const now = performance.now();
  renderTopbar(store, open, now);
  alertOfLink(now);
  renderOperatorState(store, open, now);
  renderDrive(store, open, now);
  if (document.hidden) return;
  renderTuning(store, now);
  renderExplanation(store, now);
  renderStages(store, now);
  renderMotion(store, now);
  renderIndicator(store, now);
  renderSensors(store, now);
  renderHealth(store, open, now);
  map.render(store, now);
  if (!store.isFresh("camera/picture", now)) camera.scheduleDraw();
}

addEventListener("keydown", (event) => {
  const layer = LAYERS[Number(event.key) - 1];
  if (event.ctrlKey || event.metaKey || event.altKey || isDriving()) return;
  if (layer) camera.toggle(layer);
  if (event.key === "d" || event.key === "D") nextPalette();
});
buildExplanation();
bindLink();
bindPalette();
bindAlerts();
void navigator.serviceWorker?.register("/static/service_worker.js", { scope: "/" }).catch(() => {}); // not every browser takes it
bindOperatorControls();
bindDrive();
connect(onMessage, onOpen);
setInterval(render, RENDER_PERIOD_MS);
Object.defineProperty(window, "paani", {
  value: Object.freeze({
    get overlay() { return camera.overlay; },
    get link() { return document.body.dataset.link; },
  }),
});
