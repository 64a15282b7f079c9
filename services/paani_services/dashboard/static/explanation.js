// @ts-check
// The explanation panel: steps of the decision, risk of the three corridors, input; and the panel of tracks.

import { EXPLANATION_TEXTS, ageText, byId, fixed, make, reasonText, setFacts, setText, trackLabel, words } from "./text.js";
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

/** @type {Record<string, Record<string, any>>} */
const rows = {};

export function buildExplanation() {
  for (const step of STEPS) byId("path").append(make("li", "", step));
  for (const [name, title] of CORRIDORS) {
    const row = make("div", "lane"), bars = make("div", "bars"), risk = make("strong"), parts = make("div", "parts"), verdict = make("span", "verdict");
    /** @type {Record<string, any>} */
    const widgets = { row, risk, verdict, limit: document.createElement("u") };
    for (const [part, className, letter] of PARTS) {
      widgets[part] = make("b", className);
      widgets[`${part}_text`] = make("span", "", letter);
      bars.append(widgets[part]);
      parts.append(widgets[`${part}_text`]);
    }
    bars.append(widgets.limit);
    row.append(make("span", "", title), bars, risk, parts, verdict);
    byId("lanes").append(row);
    rows[name] = widgets;
  }
}

/** @param {import("./store.js").Store} store @param {number} now */
export function renderExplanation(store, now) {
  const advisory = store.get("advisor/advisory"), settings = store.get("dashboard/settings");
  const fresh = store.isFresh("advisor/advisory", now), panel = /** @type {HTMLElement} */ (document.querySelector(".why"));
  for (const part of panel.children) if (part.tagName !== "HEADER" && part.id !== "stages") part.classList.toggle("stale", !fresh);
  setText(byId("why-age"), advisory ? `${fresh ? "" : EXPLANATION_TEXTS.stale}${ageText(store.ageS("advisor/advisory", now))}` : EXPLANATION_TEXTS.none);
  panel.dataset.empty = String(!advisory);
  const tracks = store.get("advisor/tracks");
  byId("tracks").classList.toggle("stale", !store.isFresh("advisor/tracks", now));
  setText(byId("tracks-sum"), tracks?.tracks.length ? EXPLANATION_TEXTS.tracked(tracks.tracks.length, advisory?.contributing_track_ids.length) : "");
  renderTracks(tracks, new Set(advisory?.contributing_track_ids));
  if (!advisory || !settings) return;
  setText(byId("explanation"), advisory.explanation || reasonText(advisory.reason));
  renderPath(advisory);
  const weights = weightsInForce(settings.weights, store.get("advisor/shadow"));
  for (const [name] of CORRIDORS) renderCorridor(rows[name], advisory[name], advisory[name].limit || (name === "center" ? advisory.center_block_risk : advisory.side_block_risk), weights);
  renderInput(store.get("perception/evidence"), advisory, store.ageS("perception/evidence", now));
}

/** @param {any} advisory */
function renderPath(advisory) {
  const decided = STEP_OF_REASON[advisory.reason] ?? 4;
  const stops = advisory.direction === "STOP" || advisory.direction === "NO_DATA";
  [...byId("path").children].forEach((item, index) => {
    item.dataset.step = index < decided ? "passed" : index > decided ? "" : stops ? "failed" : "decided";
    setText(item, index === decided ? reasonText(advisory.reason) : STEPS[index]);
    item.title = STEPS[index];
  });
}

/** @param {Record<string, any>} row @param {any} lane @param {number} limit @param {any} weights */
function renderCorridor(row, lane, limit, weights) {
  row.row.dataset.blocked = String(lane.blocked);
  row.limit.style.left = `${limit * 100}%`;
  setText(row.risk, fixed(lane.risk));
  setText(row.verdict, EXPLANATION_TEXTS.verdicts[lane.occupied ? "occupied" : lane.blocked ? "blocked" : "clear"]);
  for (const [part, , letter] of PARTS) {
    row[part].style.width = `${weights[part] * lane[part] * 100}%`;
    setText(row[`${part}_text`], `${letter} ${fixed(lane[part])}`);
    row[`${part}_text`].title = `${weights[part]} × ${fixed(lane[part], 3)} = ${fixed(weights[part] * lane[part], 3)}`;
  }
}

/** @param {any} evidence @param {any} advisory @param {number} ageS */
function renderInput(evidence, advisory, ageS) {
  const timing = evidence?.timing;
  setFacts(byId("input"), [
    [EXPLANATION_TEXTS.input.picture, evidence ? (evidence.usable ? EXPLANATION_TEXTS.usable : `${EXPLANATION_TEXTS.unusable}: ${words(evidence.cause)}`) : EXPLANATION_TEXTS.noPicture, Boolean(evidence && !evidence.usable)],
    [EXPLANATION_TEXTS.input.age, ageText(ageS), false],
    [EXPLANATION_TEXTS.input.mask, evidence ? words(evidence.segmentation) : "–", Boolean(evidence && evidence.segmentation !== "learned")],
    [EXPLANATION_TEXTS.input.inference, timing ? `${fixed(timing.inference_ms, 0)} ms` : "–", false],
  ]);
}

/** @param {any} message @param {Set<number>} counting */
function renderTracks(message, counting) {
  const tracks = message?.tracks ?? [], list = byId("tracks");
  if (!tracks.length) {
    list.replaceChildren(make("p", "quiet", EXPLANATION_TEXTS.noTracks));
    return;
  }
  list.replaceChildren(
    ...tracks.map((/** @type {any} */ track) => {
      const row = make("div"), known = track.motion === "unknown" ? "" : track.motion;
      row.dataset.counts = String(counting.has(track.id));
      row.append(make("span", "", trackLabel(track)), make("span", "", [track.held ? EXPLANATION_TEXTS.unseen : "", known].filter(Boolean).join(", ")));
      return row;
    }),
  );
}
