// @ts-check
// The indicator strip: what the microcontroller shows, and how well it is reached. Hidden where no bridge runs.

import { isReplay } from "./inhibits.js";
import { INDICATOR_TEXTS, byId, fixed, setText } from "./text.js";
import { ADVICE } from "./topbar.js";

/** @param {import("./store.js").Store} store @param {number} now */
export function renderIndicator(store, now) {
  const strip = byId("indicator");
  strip.hidden = !store.get("dashboard/settings")?.services.includes("bridge") || (isReplay(store) && !store.isFresh("bridge/state", now));
  if (strip.hidden) return;
  const state = store.get("bridge/state"), fresh = store.isFresh("bridge/state", now);
  const problem = !state ? INDICATOR_TEXTS.none : !fresh ? INDICATOR_TEXTS.silent : state.problem;
  const known = fresh && state.mcu !== "unknown";
  const [word, kind, arrow] = ADVICE[known ? state.display : "NO_DATA"];
  strip.dataset.kind = kind;
  strip.dataset.problem = String(Boolean(problem));
  if (strip.dataset.arrow !== arrow) {
    strip.dataset.arrow = arrow;
    byId("indicator-arrow").innerHTML = `<path d="${arrow}"/>`;
  }
  setText(byId("indicator-word"), known ? word : INDICATOR_TEXTS.unknown);
  setText(byId("indicator-facts"), problem || factsText(state));
  strip.title = state ? `${state.line}: ${countsText(state)}` : "";
}

/** @param {any} state */
const factsText = (state) => INDICATOR_TEXTS.facts(state.mcu, fixed(state.round_trip_p50_ms, 1), state.boot_count);

/** @param {any} state */
function countsText(state) {
  const refused = Object.entries(state).filter(([name, count]) => name.startsWith("refused_") && count);
  const causes = refused.map(([name, count]) => `${name.slice(8).replaceAll("_", " ")} ${count}`).join(", ");
  return INDICATOR_TEXTS.counts(state.answered, state.sent, fixed(state.round_trip_p95_ms, 1), causes, state.reset_cause.replaceAll("_", " "));
}
