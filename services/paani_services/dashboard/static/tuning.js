// @ts-check
// Parameters tried beside those in force: what they are and where the advice would differ. Nothing to show, no strip.

import { byId, fixed, reasonText, setText } from "./text.js";

/** @param {import("./store.js").Store} store @param {number} now */
export function renderTuning(store, now) {
  const said = store.get("advisor/shadow"), strip = byId("tuning");
  strip.hidden = !said || !(said.active || said.proposal);
  byId("panels").dataset.tuning = String(!strip.hidden);
  if (strip.hidden) return;
  strip.classList.toggle("stale", !store.isFresh("advisor/shadow", now));
  const force = byId("tuning-force"), counts = byId("tuning-counts"), last = said.recent.at(-1);
  force.dataset.promoted = String(Boolean(said.active));
  setText(force, said.active ? `${said.active} in force: ${changes(said.active_changes)}` : "the configuration in force");
  setText(byId("tuning-tried"), said.proposal ? `${said.proposal} tried: ${changes(said.changes)}` : "");
  counts.dataset.moves = String(said.moves_more > 0);
  setText(counts, said.proposal ? countsText(said) : "");
  setText(byId("tuning-last"), last ? `last: ${advice(last, "active")}, tried: ${advice(last, "shadow")}` : "");
}

/** The configured weights of the risk with those promoted. @param {Record<string, number>} configured @param {any} said */
export function weightsInForce(configured, said) {
  const promoted = (said?.active_changes ?? []).filter((/** @type {any} */ change) => change.path.startsWith("advisor.risk."));
  return { ...configured, ...Object.fromEntries(promoted.map((/** @type {any} */ change) => [change.path.slice(13), Number(change.value)])) };
}

/** @param {any} said */
function countsText(said) {
  const differing = `${said.differing} of ${said.frames} frames differ (${fixed(100 * said.differing_frac, 1)} %)`;
  return `${differing}, would move on ${said.moves_more} where it stops, stop on ${said.stops_more} where it moves`;
}

/** @param {{path: string, value: string}[]} list */
const changes = (list) => list.map((change) => `${change.path.replace(/^advisor\./, "")} = ${change.value}`).join(", ");

/** @param {any} found @param {"active" | "shadow"} which */
const advice = (found, which) =>
  `${found[`${which}_direction`].replaceAll("_", " ")} (${reasonText(found[`${which}_reason`]).toLowerCase()})`;
