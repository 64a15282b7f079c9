// @ts-check
// The indicator strip: what the microcontroller shows, and how well it is reached. Hidden where no bridge runs.

import { isReplay } from "./inhibits.js";
import { byId, fixed, setText } from "./text.js";
import { ADVICE } from "./topbar.js";

/** @param {import("./store.js").Store} store @param {number} now */
export function renderIndicator(store, now) {
  const strip = byId("indicator");
  strip.hidden = !store.get("dashboard/settings")?.services.includes("bridge") || (isReplay(store) && !store.isFresh("bridge/state", now));
  if (strip.hidden) return;
  const state = store.get("bridge/state"), fresh = store.isFresh("bridge/state", now);
  const problem = !state ? "no report from the bridge yet" : !fresh ? "the bridge is silent" : state.problem;
  const known = fresh && state.mcu !== "unknown";
  const [word, kind, arrow] = ADVICE[known ? state.display : "NO_DATA"];
  strip.dataset.kind = kind;
  strip.dataset.problem = String(Boolean(problem));
  if (strip.dataset.arrow !== arrow) {
    strip.dataset.arrow = arrow;
    byId("indicator-arrow").innerHTML = `<path d="${arrow}"/>`;
  }
  setText(byId("indicator-word"), known ? word : "UNKNOWN");
  setText(byId("indicator-facts"), problem || factsText(state));
  strip.title = state ? `${state.line}: ${countsText(state)}` : "";
}

/** @param {any} state */
const factsText = (state) => `${state.mcu} · ${fixed(state.round_trip_p50_ms, 1)} ms · boot ${state.boot_count}`;

/** @param {any} state */
function countsText(state) {
  const refused = Object.entries(state).filter(([name, count]) => name.startsWith("refused_") && count);
  const causes = refused.map(([name, count]) => `${name.slice(8).replaceAll("_", " ")} ${count}`).join(", ");
  return `${state.answered} of ${state.sent} frames answered, p95 ${fixed(state.round_trip_p95_ms, 1)} ms, refused: ${causes || "none"}; last reset: ${state.reset_cause.replaceAll("_", " ")}`;
}
