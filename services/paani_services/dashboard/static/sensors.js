// @ts-check
// The sensor strip: each device of a real hull, and what is wrong with it. Hidden where no sensor process runs.

import { isReplay } from "./inhibits.js";
import { SENSOR_TEXTS, byId, fixed, make, setText } from "./text.js";

/** @type {Map<string, HTMLElement>} */
const rows = new Map();

/** @param {import("./store.js").Store} store @param {number} now */
export function renderSensors(store, now) {
  const strip = byId("sensors");
  strip.hidden = !store.get("dashboard/settings")?.services.includes("sensors") || (isReplay(store) && !store.isFresh("sensors/state", now));
  if (strip.hidden) return;
  const state = store.get("sensors/state"), fresh = store.isFresh("sensors/state", now);
  const devices = state?.devices ?? [{ role: "sensors", status: "silent", note: SENSOR_TEXTS.none }];
  for (const device of devices) {
    const row = rowOf(strip, device.role), status = fresh || !state ? device.status : "silent";
    row.dataset.status = status;
    row.title = device.line ? `${device.line}: ${SENSOR_TEXTS.counts(device)}` : "";
    setText(/** @type {HTMLElement} */ (row.children[0]), device.role);
    setText(/** @type {HTMLElement} */ (row.children[1]), status.replaceAll("_", " "));
    setText(/** @type {HTMLElement} */ (row.children[2]), fresh ? device.note || rateText(device) : device.note || SENSOR_TEXTS.silent);
  }
  for (const [role, row] of rows) row.hidden = !devices.some((/** @type {any} */ device) => device.role === role);
}

/** @param {HTMLElement} strip @param {string} role */
function rowOf(strip, role) {
  let row = rows.get(role);
  if (!row) {
    row = make("div");
    row.append(make("span"), make("b"), make("span"));
    strip.append(row);
    rows.set(role, row);
  }
  return row;
}

/** @param {any} device */
const rateText = (device) => (device.status === "off" ? "" : `${fixed(device.rate_hz, device.rate_hz < 10 ? 1 : 0)} Hz`);
