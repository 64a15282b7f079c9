// @ts-check
// The tuning strip: parameters on trial beside those in force, and where their advice differs. Hidden without any.

import { computed, effect, html, moment, mount } from "./templates.js";
import { TUNING_TEXTS, byId, fixed, reasonText } from "./text.js";

const shadow = computed(() => moment.value.store.get("advisor/shadow"));
const isShown = computed(() => Boolean(shadow.value?.active || shadow.value?.proposal));
const isStale = computed(() => !moment.value.store.isFresh("advisor/shadow", moment.value.now));

export function bindTuning() {
  effect(() => {
    byId("tuning").hidden = !isShown.value;
    byId("panels").dataset.tuning = String(isShown.value);
    byId("tuning").classList.toggle("stale", isStale.value);
  });
  mount("#tuning", () => isShown.value && view(shadow.value));
}

/** @param {any} shadow */
function view(shadow) {
  const last = shadow.recent.at(-1);
  return html`<h2>${TUNING_TEXTS.title}</h2>
    <span id="tuning-force" data-promoted=${Boolean(shadow.active)}>${shadow.active ? TUNING_TEXTS.inForce(shadow.active, changesText(shadow.active_changes)) : TUNING_TEXTS.configured}</span>
    <span id="tuning-tried">${shadow.proposal && TUNING_TEXTS.tried(shadow.proposal, changesText(shadow.changes))}</span>
    <span id="tuning-counts" data-moves=${shadow.moves_more > 0}>${shadow.proposal && countsText(shadow)}</span>
    <span id="tuning-last" class="quiet">${last && TUNING_TEXTS.last(adviceText(last, "active"), adviceText(last, "shadow"))}</span>`;
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
