// @ts-check
// The indicator strip: what the microcontroller shows, and how well it is reached. Hidden where no bridge runs.

import { isReplay } from "./inhibits.js";
import { html } from "./templates.js";
import { INDICATOR_TEXTS, fixed } from "./text.js";
import { ADVICE } from "./topbar.js";

/** @param {import("./templates.js").Moment} moment */
export function indicatorStrip({ store, now }) {
  const state = store.get("bridge/state"), isFresh = store.isFresh("bridge/state", now);
  const isShown = store.get("dashboard/settings")?.services.includes("bridge") && (isFresh || !isReplay(store));
  const problem = !state ? INDICATOR_TEXTS.none : !isFresh ? INDICATOR_TEXTS.silent : state.problem;
  const isKnown = isFresh && state.mcu !== "unknown", [word, kind, arrow] = ADVICE[isKnown ? state.display : "NO_DATA"];
  return html`<div id="indicator" class="indicator" role="status" aria-label=${INDICATOR_TEXTS.title} hidden=${!isShown} data-kind=${kind} data-problem=${Boolean(problem)} title=${state ? `${state.line}: ${countsText(state)}` : ""}>
    <svg id="indicator-arrow" viewBox="0 0 48 48" aria-hidden="true"><path d=${arrow} /></svg><span class="quiet">${INDICATOR_TEXTS.leds}</span>
    <b id="indicator-word">${isKnown ? word : INDICATOR_TEXTS.unknown}</b><span id="indicator-facts">${problem || factsText(state)}</span></div>`;
}

/** @param {any} state */
const factsText = (state) => INDICATOR_TEXTS.facts(state.mcu, fixed(state.round_trip_p50_ms, 1), state.boot_count);

/** @param {any} state */
function countsText(state) {
  const refused = Object.entries(state).filter(([name, count]) => name.startsWith("refused_") && count);
  const causes = refused.map(([name, count]) => `${name.slice(8).replaceAll("_", " ")} ${count}`).join(", ");
  return INDICATOR_TEXTS.counts(state.answered, state.sent, fixed(state.round_trip_p95_ms, 1), causes, state.reset_cause.replaceAll("_", " "));
}
