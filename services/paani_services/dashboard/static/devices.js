// @ts-check
// The tab of a hull's devices: its sensors, the bridge to the indicator, and the line to the thrusters. Hidden without any.

import { shownTab } from "./tabs.js";
import { cell, effect, facts, html, mount, tableHead, tableMoment } from "./templates.js";
import { DEVICE_FACTS, DEVICE_TEXTS, NEVER, ageText, agoText, byId, fixed, words } from "./text.js";

const NO_ANSWER_MS = 1e9; // the age of an answer before the first
const CODE = /^[A-Za-z]+(_[A-Za-z]+)+$|^[A-Z]+$/; // an enumeration's value, and not what a device says
const LINES = /** @type {const} */ (["bridge", "thrusters"]);
/** @type {Record<string, string>} */
const KINDS = { ok: "good", off: "quiet", no_fix: "warn" };

const services = () => /** @type {string[]} */ (tableMoment.value.store.get("dashboard/settings")?.services ?? []);

export function bindDevices() {
  effect(() => { byId("tab-devices").hidden = !["sensors", ...LINES].some((name) => services().includes(name)); });
  mount("[data-tab-panel=devices]", () => shownTab.value === "devices" && html`${services().includes("sensors") && sensors(tableMoment.value)}${LINES.filter((name) => services().includes(name)).map((name) => line(tableMoment.value, name))}`);
}

/** @param {import("./templates.js").Moment} moment */
function sensors({ store, now }) {
  return html`<div id="sensors-device" class="panel" tabindex="0" role="group" aria-label=${DEVICE_TEXTS.sensors}><header><h2>${DEVICE_TEXTS.sensors}</h2></header>
    <table class="cards">${tableHead(DEVICE_TEXTS.columns, [3, 4, 5, 6, 7])}<tbody id="sensor-devices" class=${store.isFresh("sensors/state", now) ? "" : "stale"}>${(store.get("sensors/state")?.devices ?? []).map(device)}</tbody></table></div>`;
}

/** @param {any} device */
const device = ({ role, status, line, note, heard, ...counts }) => html`<tr key=${role}><td>${role}</td>${[
  [status.replaceAll("_", " "), KINDS[status] ?? "bad"], [line || "–", "wide"], [`${fixed(counts.rate_hz, 1)} Hz`, "number"],
  ...["checksum_failures", "damaged", "withheld", "reconnections"].map((name) => [counts[name], "number"]), [[note, heard].filter(Boolean).join("; "), "wide"],
].map(([value, kind], column) => cell(DEVICE_TEXTS.columns[column + 1], value, kind))}</tr>`;

/** @param {import("./templates.js").Moment} moment @param {"bridge" | "thrusters"} name */
function line({ store, now }, name) {
  const key = `${name}/state`, state = store.get(key);
  return html`<div id="${name}-device" class="panel ${store.isFresh(key, now) ? "" : "stale"}"><header><h2>${DEVICE_TEXTS[name]}</h2><span id="${name}-age" class="quiet">${state ? agoText(ageText(store.ageS(key, now))) : DEVICE_TEXTS.none}</span></header>
    <dl id="${name}-facts" class="facts">${facts(state ? factsOf(state) : [])}</dl></div>`;
}

/** Every field of a state but its header. @param {any} state @returns {[string, string, boolean][]} */
const factsOf = (state) =>
  Object.entries(state).filter(([name]) => !DEVICE_FACTS.header.includes(name)).map(([name, value]) => [words(name), valueText(name, value), name === "problem" && Boolean(value)]);

/** @param {string} name @param {any} value @returns {string} */
function valueText(name, value) {
  if (typeof value === "boolean") return value ? DEVICE_TEXTS.yes : DEVICE_TEXTS.no;
  if (typeof value === "number") return value === NO_ANSWER_MS ? NEVER : Number.isInteger(value) ? String(value) : fixed(value);
  if (Array.isArray(value)) return value.map(words).join(", ") || "–";
  return value === "" ? "–" : CODE.test(value) ? words(value) : String(value);
}
