// @ts-check
// The tab of a hull's devices: its sensors, the bridge to the indicator, and the line to the thrusters. Hidden without any.

import { DEVICE_FACTS, DEVICE_TEXTS, ageText, agoText, byId, fixed, make, setFacts, setText } from "./text.js";

const TOPICS = ["sensors/state", "bridge/state", "thrusters/state"];
const NAMES = ["sensors", "bridge", "thrusters"];

/** @param {import("./store.js").Store} store @param {number} now */
export function renderDevices(store, now) {
  const services = store.get("dashboard/settings")?.services ?? [];
  byId("tab-devices").hidden = !NAMES.some((name) => services.includes(name));
  if (byId("devices").hidden) return;
  renderSensors(store, now);
  NAMES.slice(1).forEach((name, index) => {
    const key = TOPICS[index + 1], state = store.get(key), panel = byId(`${name}-device`);
    panel.hidden = !services.includes(name);
    panel.classList.toggle("stale", !store.isFresh(key, now));
    setText(byId(`${name}-age`), state ? agoText(ageText(store.ageS(key, now))) : DEVICE_TEXTS.none);
    setFacts(byId(`${name}-facts`), state ? factsOf(state) : []);
  });
}

/** @param {import("./store.js").Store} store @param {number} now */
function renderSensors(store, now) {
  const state = store.get("sensors/state"), devices = state?.devices ?? [], body = byId("sensor-devices");
  byId("sensors-device").hidden = !store.get("dashboard/settings")?.services.includes("sensors");
  body.classList.toggle("stale", !store.isFresh("sensors/state", now));
  while (body.children.length > devices.length) body.lastChild.remove();
  devices.forEach((/** @type {any} */ device, /** @type {number} */ index) => {
    const row = body.children[index] ?? body.appendChild(make("tr"));
    while (row.children.length < 9) row.append(make("td", row.children.length > 2 && row.children.length < 8 ? "number" : row.children.length === 8 ? "wide" : ""));
    const texts = [
      device.role, device.status.replaceAll("_", " "), device.line || "–", `${fixed(device.rate_hz, 1)} Hz`, device.checksum_failures,
      device.damaged, device.withheld, device.reconnections, [device.note, device.heard].filter(Boolean).join("; "),
    ];
    texts.forEach((text, at) => setText(row.children[at], String(text)));
    row.children[1].className = device.status === "ok" ? "good" : device.status === "off" ? "quiet" : device.status === "no_fix" ? "warn" : "bad";
  });
}

/** Every field of a state but its header. @param {any} state @returns {[string, string, boolean][]} */
const factsOf = (state) =>
  Object.entries(state).filter(([name]) => !DEVICE_FACTS.header.includes(name)).map(([name, value]) => [
    name.replaceAll("_", " "), typeof value === "number" && !Number.isInteger(value) ? fixed(value) : typeof value === "object" ? JSON.stringify(value) : String(value === "" ? "–" : value), name === "problem" && Boolean(value),
  ]);
