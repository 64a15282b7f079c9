// @ts-check
// The tuning strip: parameters on trial beside those in force, and where their advice differs. Hidden without any.

import { TUNING_TEXTS, byId, fixed, reasonText, setText } from "./text.js";

/** @param {import("./store.js").Store} store @param {number} now */
export function renderTuning(store, now) {
  const shadow = store.get("advisor/shadow"), strip = byId("tuning");
  strip.hidden = !shadow || !(shadow.active || shadow.proposal);
  byId("panels").dataset.tuning = String(!strip.hidden);
  if (strip.hidden) return;
  strip.classList.toggle("stale", !store.isFresh("advisor/shadow", now));
  const force = byId("tuning-force"), counts = byId("tuning-counts"), last = shadow.recent.at(-1);
  force.dataset.promoted = String(Boolean(shadow.active));
  setText(force, shadow.active ? TUNING_TEXTS.inForce(shadow.active, changesText(shadow.active_changes)) : TUNING_TEXTS.configured);
  setText(byId("tuning-tried"), shadow.proposal ? TUNING_TEXTS.tried(shadow.proposal, changesText(shadow.changes)) : "");
  counts.dataset.moves = String(shadow.moves_more > 0);
  setText(counts, shadow.proposal ? countsText(shadow) : "");
  setText(byId("tuning-last"), last ? TUNING_TEXTS.last(adviceText(last, "active"), adviceText(last, "shadow")) : "");
}

/** The weights of the risk in force: those configured, and over them those promoted. @param {Record<string, number>} configured @param {any} shadow */
export function weightsInForce(configured, shadow) {
  const promoted = (shadow?.active_changes ?? []).filter((/** @type {any} */ change) => change.path.startsWith("advisor.risk."));
  return { ...configured, ...Object.fromEntries(promoted.map((/** @type {any} */ change) => [change.path.slice(13), Number(change.value)])) };
}

/** @param {any} shadow */
export function countsText(shadow) {
  return TUNING_TEXTS.counts(shadow, fixed(100 * shadow.differing_frac, 1));
}

/** @param {{path: string, value: string}[]} list */
export const changesText = (list) => list.map((change) => `${change.path.replace(/^advisor\./, "")} = ${change.value}`).join(", ");

/** @param {any} disagreement @param {"active" | "shadow"} which */
const adviceText = (disagreement, which) =>
  `${disagreement[`${which}_direction`].replaceAll("_", " ")} (${reasonText(disagreement[`${which}_reason`]).toLowerCase()})`;
