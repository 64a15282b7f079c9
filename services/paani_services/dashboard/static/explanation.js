// @ts-check
// The explanation panel: steps of the decision, risk of the three corridors, input; and the panel of tracks.

import { stages } from "./stages.js";
import { computed, facts, html, moment, mount } from "./templates.js";
import { EXPLANATION_TEXTS, ageText, fixed, reasonText, trackLabel, words } from "./text.js";
import { weightsInForce } from "./tuning.js";

const CORRIDORS = Object.entries(EXPLANATION_TEXTS.corridors);
const PARTS = [["non_water", "n", "N"], ["obstacle", "o", "O"], ["urgency", "m", "M"], ["uncertainty", "u", "U"]];
const STEPS = EXPLANATION_TEXTS.steps;
/** Index in STEPS of the step that decided. @type {Record<string, number>} */
const STEP_OF_REASON = {
  UNUSABLE_IMAGE: 0, MALFORMED_EVIDENCE: 0, NO_EVIDENCE: 0, STALE_EVIDENCE: 1, FUTURE_EVIDENCE: 1,
  CENTER_CLEAR: 2, CENTER_EDGE_INCURSION: 3, CENTER_RISK: 3, CENTER_OCCUPIED: 3, CENTER_VESSEL: 3,
  NO_SAFE_SIDE: 3, NO_SIDE_UNOCCUPIED: 3, NO_SIDE_FOR_LONG: 3, TIE_KEPT_SIDE: 3, TIE_STARBOARD: 3, TURN_RETAINED: 4,
};

/** @param {string} key */
const newest = (key) => computed(() => moment.value.store.get(key));
const settings = newest("dashboard/settings"), advisory = newest("advisor/advisory"), tracked = newest("advisor/tracks"), shadow = newest("advisor/shadow");
const areTracksFresh = computed(() => moment.value.store.isFresh("advisor/tracks", moment.value.now));
// What only changes with a message is not made anew for its age.
const steps = computed(() => stepsOf(settings.value && advisory.value));
const corridors = computed(() => settings.value && advisory.value && corridorsOf(advisory.value, weightsInForce(settings.value.weights, shadow.value)));

export function bindExplanation() {
  mount(".why", () => explanation(moment.value));
  mount(".seen", tracks);
}

/** @param {import("./templates.js").Moment} moment */
function explanation({ store, now }) {
  const isFresh = store.isFresh("advisor/advisory", now), stale = isFresh ? "" : "stale";
  const advice = settings.value && advisory.value, age = advice ? `${isFresh ? "" : EXPLANATION_TEXTS.stale}${ageText(store.ageS("advisor/advisory", now))}` : EXPLANATION_TEXTS.none;
  return html`<header><h2>${EXPLANATION_TEXTS.title}</h2><span id="why-age" class="quiet">${age}</span></header>
    <p id="explanation" class="explanation ${stale}">${advice && (advice.explanation || reasonText(advice.reason))}</p>
    <ol id="path" class="path ${stale}" aria-label=${EXPLANATION_TEXTS.path} style=${advice ? null : { visibility: "hidden" }}>${steps.value}</ol>
    ${stages()}
    ${advice && html`
      <div id="lanes" class="lanes ${stale}">${corridors.value}</div>
      <p class="legend weights ${stale}">${Object.entries(EXPLANATION_TEXTS.parts).map(([kind, text]) => html`<span><i class=${kind}></i> ${text}</span>`)}</p>
      <h3 class=${stale}>${EXPLANATION_TEXTS.inputTitle}</h3>
      <dl id="input" class="facts ${stale}">${facts(inputOf(store.get("perception/evidence"), store.ageS("perception/evidence", now)))}</dl>`}`;
}

/** @param {any} advisory undefined: none */
function stepsOf(advisory) {
  const decided = advisory ? STEP_OF_REASON[advisory.reason] ?? 4 : -1;
  const stops = advisory?.direction === "STOP" || advisory?.direction === "NO_DATA";
  return STEPS.map((step, index) => html`<li data-step=${index < decided ? "passed" : index > decided ? "" : stops ? "failed" : "decided"} title=${step}>${index === decided ? reasonText(advisory.reason) : step}</li>`);
}

/** @param {any} advisory @param {any} weights */
const corridorsOf = (advisory, weights) => CORRIDORS.map(([name, title]) => {
  const lane = advisory[name], limit = lane.limit || (name === "center" ? advisory.center_block_risk : advisory.side_block_risk);
  return html`<div class="lane" data-blocked=${lane.blocked}><span>${title}</span>
    <div class="bars">${PARTS.map(([part, kind]) => html`<b class=${kind} style=${{ width: `${weights[part] * lane[part] * 100}%` }}></b>`)}<u style=${{ left: `${limit * 100}%` }}></u></div>
    <strong>${fixed(lane.risk)}</strong>
    <div class="parts">${PARTS.map(([part, , letter]) => html`<span title="${weights[part]} × ${fixed(lane[part], 3)} = ${fixed(weights[part] * lane[part], 3)}">${letter} ${fixed(lane[part])}</span>`)}</div>
    <span class="verdict">${EXPLANATION_TEXTS.verdicts[lane.occupied ? "occupied" : lane.blocked ? "blocked" : "clear"]}</span></div>`;
});

/** @param {any} evidence @param {number} ageS @returns {[string, string, boolean?][]} */
const inputOf = (evidence, ageS) => [
  [EXPLANATION_TEXTS.input.picture, evidence ? (evidence.usable ? EXPLANATION_TEXTS.usable : `${EXPLANATION_TEXTS.unusable}: ${words(evidence.cause)}`) : EXPLANATION_TEXTS.noPicture, Boolean(evidence && !evidence.usable)],
  [EXPLANATION_TEXTS.input.age, ageText(ageS)],
  [EXPLANATION_TEXTS.input.mask, evidence ? words(evidence.segmentation) : "–", Boolean(evidence && evidence.segmentation !== "learned")],
  [EXPLANATION_TEXTS.input.inference, evidence?.timing ? `${fixed(evidence.timing.inference_ms, 0)} ms` : "–"],
];

function tracks() {
  const tracks = tracked.value?.tracks ?? [], counting = advisory.value?.contributing_track_ids;
  return html`<header><h2>${EXPLANATION_TEXTS.tracks}</h2><span id="tracks-sum" class="quiet">${tracks.length > 0 && EXPLANATION_TEXTS.tracked(tracks.length, counting?.length)}</span></header>
    <div id="tracks" class="tracks ${areTracksFresh.value ? "" : "stale"}" tabindex="0" role="group" aria-label=${EXPLANATION_TEXTS.tracks}>
      ${tracks.length ? tracks.map((/** @type {any} */ track) => html`<div key=${track.id} data-counts=${Boolean(counting?.includes(track.id))}><span>${trackLabel(track)}</span>
        <span>${[track.held && EXPLANATION_TEXTS.unseen, track.motion !== "unknown" && track.motion].filter(Boolean).join(", ")}</span></div>`) : html`<p class="quiet">${EXPLANATION_TEXTS.noTracks}</p>`}</div>`;
}
