// @ts-check
// The sensor strip: each device of a real hull, and what is wrong with it. Hidden where no sensor process runs.

import { isReplay } from "./inhibits.js";
import { html } from "./templates.js";
import { SENSOR_TEXTS, fixed } from "./text.js";

/** @param {import("./templates.js").Moment} moment */
export function sensorStrip({ store, now }) {
  const state = store.get("sensors/state"), isFresh = store.isFresh("sensors/state", now);
  const isShown = store.get("dashboard/settings")?.services.includes("sensors") && (isFresh || !isReplay(store));
  const devices = state?.devices ?? [{ role: "sensors", status: "silent", note: SENSOR_TEXTS.none }];
  return html`<div id="sensors" class="sensors" role="status" aria-label=${SENSOR_TEXTS.title} hidden=${!isShown}>${isShown && devices.map((/** @type {any} */ device) => {
    const status = isFresh || !state ? device.status : "silent";
    return html`<div key=${device.role} data-status=${status} title=${device.line ? `${device.line}: ${SENSOR_TEXTS.counts(device)}` : ""}>
      <span>${device.role}</span><b>${status.replaceAll("_", " ")}</b><span>${device.note || (isFresh ? rateText(device) : SENSOR_TEXTS.silent)}</span></div>`;
  })}</div>`;
}

/** @param {any} device */
const rateText = (device) => (device.status === "off" ? "" : `${fixed(device.rate_hz, device.rate_hz < 10 ? 1 : 0)} Hz`);
