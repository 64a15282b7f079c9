// @ts-check
// Connects the WebSocket to the store and the panels.

import "./page_text.js"; // before any script looks at what it says
import { alertOf, alertOfLink, bindAlerts } from "./alerts.js";
import { Camera } from "./camera.js";
import { CAMERA_KEYS } from "./camera_frames.js";
import { bindDevices } from "./devices.js";
import { bindDrive, isDriving, renderDrive } from "./drive.js";
import { bindExplanation } from "./explanation.js";
import { decodeJson } from "./frames.js";
import { bindHealth } from "./health.js";
import { bindLink, renderLink } from "./link.js";
import { addLine, bindLog, clearLog, logAdvice } from "./log.js";
import { MapPanel } from "./map.js";
import { bindMotion } from "./motion.js";
import { bindOperatorControls, renderOperatorState } from "./operator.js";
import { bindPalette, nextPalette } from "./palette.js";
import { requireSession } from "./requests.js";
import { bindRecordings } from "./recordings.js";
import { bindSettings } from "./settings.js";
import { bindRoom } from "./room.js";
import { connect } from "./socket.js";
import { bindTabs, isDriveTab } from "./tabs.js";
import { Time, isTyping } from "./time.js";
import { showMoment } from "./templates.js";
import { bindTopics } from "./topics.js";
import { renderTopbar } from "./topbar.js";
import { bindTuning } from "./tuning.js";
import { View } from "./view.js";

const RENDER_PERIOD_MS = 100, REPLAY_AGAIN_MS = 3000, BUSY = 503;
const LAYERS = ["mask", "boxes", "lanes", "limit", "hull"];
const live = new View(() => performance.now());
const camera = new Camera(live);
const map = new MapPanel();
const time = new Time(live, () => camera.scheduleDraw());
const fromS = Number(new URLSearchParams(location.hash.slice(1)).get("at")) || 0; // seconds since a recording's start
let open = false, opened = 0, isReplayed = false;

/** @param {string} key @param {import("./frames.js").FrameHeader} header @param {Uint8Array} body */
function onMessage(key, header, body) {
  if (key === "dashboard/event") {
    const event = decodeJson(body);
    addLine(event);
    alertOf(event.level, header.age_ms);
    time.history.series.addEvent(event);
    return;
  }
  const { value, drawn } = live.put(key, header, body, performance.now());
  if (!time.isPast && CAMERA_KEYS.has(key)) void drawn.then(() => camera.scheduleDraw());
  if (key === "advisor/advisory") logAdvice(value);
  if (key === "dashboard/settings" && value.replayed) replay(value.replayed);
  if (key === "dashboard/sample") time.history.series.append(value);
}

/** Once, and again where the server was busy or gone: the settings come again with each connection. @param {string} name of the recording that this page is of */
function replay(name) {
  if (isReplayed) return;
  isReplayed = true;
  time.replay(name, fromS).catch((error) => {
    addLine({ at_us: Date.now() * 1000, level: "warn", text: `${name}: ${error.message}` });
    isReplayed = false;
    if (error.cause === BUSY) setTimeout(() => replay(name), REPLAY_AGAIN_MS);
  });
}

/** @param {boolean} isOpen */
function onOpen(isOpen) {
  open = isOpen;
  void requireSession();
  if (isOpen) void time.reload();
  if (isOpen && opened++ > 0) clearLog();
}

function render() {
  const present = performance.now();
  time.render(present);
  const { view } = time, { store } = view, now = view.now(), isOpen = open || time.isPast;
  renderTopbar(store, isOpen, now);
  renderLink(live.store, open, present);
  alertOfLink(present);
  renderOperatorState(live.store, open, present, time.isPast);
  renderDrive(live.store, open, present, time.isPast || !isDriveTab());
  camera.show(view);
  if (document.hidden) return;
  showMoment({ store, now, isOpen }, { store: live.store, now: present, isOpen: open }, isDriveTab());
  if (!isDriveTab()) return;
  map.render(view, now);
  if (time.isPast || !store.isFresh("camera/picture", now)) camera.scheduleDraw();
}

addEventListener("keydown", (event) => {
  const layer = LAYERS[Number(event.key) - 1];
  if (event.ctrlKey || event.metaKey || event.altKey || isDriving() || isTyping(event.target)) return;
  if (layer) camera.toggle(layer);
  if (event.key === "d" || event.key === "D") nextPalette();
});
bindLink();
bindPalette();
bindAlerts();
void navigator.serviceWorker?.register("/static/service_worker.js", { scope: "/" }).catch(() => {}); // not every browser takes it
bindTabs();
bindTuning();
bindExplanation();
bindMotion();
bindLog();
bindTopics();
bindRecordings(time);
bindSettings();
bindDevices();
bindHealth();
bindOperatorControls();
bindDrive();
bindRoom();
connect(onMessage, onOpen);
setInterval(render, RENDER_PERIOD_MS);
Object.defineProperty(window, "paani", {
  value: Object.freeze({
    get overlay() { return camera.overlay; },
    get shownUs() { return time.isPast ? time.playback.atUs : null; },
    get plan() { return structuredClone(map.editor.made.plan); },
    get marks() { return structuredClone(map.editor.marks); },
    get link() { return document.body.dataset.link; },
  }),
});
