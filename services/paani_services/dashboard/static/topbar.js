// @ts-check
// The top bar: mode, link, what the boat does, advice, speed, heading, battery and recording.

import { describeActivity } from "./activity.js";
import { announce } from "./announcer.js";
import { ACTIVITIES, ADVICE_TEXTS, MODES, RECORD_TEXTS, TIME_TEXTS, ageText, byId, fixed, headingDeg, reasonText, sentence, setText, words } from "./text.js";

const NOT_HEARD = { id: "UNKNOWN", word: ACTIVITIES.UNKNOWN[0], kind: "none", reason: TIME_TEXTS.noServer };
/** Kind and SVG path of the arrow. @type {Record<string, [string, string]>} */
const ARROWS = {
  STRAIGHT: ["go", "M24 42V7M11 20L24 7l13 13"],
  SLIGHT_LEFT: ["turn", "M29 42V26L14 10M13 25V9h16"],
  SLIGHT_RIGHT: ["turn", "M19 42V26L34 10M35 25V9H19"],
  LEFT: ["turn", "M36 42V20H9M21 8L9 20l12 12"],
  RIGHT: ["turn", "M12 42V20h27M27 8l12 12-12 12"],
  STOP: ["stop", "M16 6h16l10 10v16L32 42H16L6 32V16zM15 24h18"],
  NO_DATA: ["none", "M10 24h6M22 24h4M32 24h6"],
};
/** Word, kind and SVG path of the arrow. @type {Record<string, [string, string, string]>} */
export const ADVICE = Object.fromEntries(Object.entries(ARROWS).map(([name, arrow]) => [name, [ADVICE_TEXTS.words[name], ...arrow]]));

/** @param {import("./store.js").Store} store @param {boolean} open @param {number} now */
export function renderTopbar(store, open, now) {
  const settings = store.get("dashboard/settings");
  if (settings) {
    setText(byId("vessel"), `${settings.vessel} · ${settings.domain}`);
    const from = settings.mode === "sim" && settings.pictures !== "sim" ? ` · ${settings.pictures}` : "";
    setText(byId("mode"), MODES[settings.mode] + from);
    document.documentElement.dataset.mode = settings.mode;
    renderRecord(store, settings.services.includes("recorder") && settings.mode !== "replay", now);
  }
  const doing = open ? describeActivity(store, now) : NOT_HEARD;
  setText(byId("activity-word"), doing.word);
  setText(byId("activity-reason"), sentence(doing.reason));
  byId("activity").dataset.kind = doing.kind;
  byId("activity").dataset.activity = doing.id;
  const advice = renderAdvice(store, now);
  announce(ADVICE_TEXTS.announced(doing.word, advice), doing.kind === "stop", now);
  renderPose(store, now);
}

/** The recording chip, hidden where nothing is to be recorded. @param {import("./store.js").Store} store @param {boolean} isWanted @param {number} now */
function renderRecord(store, isWanted, now) {
  const chip = byId("record"), state = store.get("recorder/state");
  const on = store.isFresh("recorder/state", now) && state.recording;
  chip.hidden = !isWanted;
  chip.dataset.record = !on ? "off" : state.dropped ? "loses" : "on";
  const lost = on && state.dropped ? `, ${RECORD_TEXTS.dropped(state.dropped)}` : "";
  setText(chip, on ? `${RECORD_TEXTS.on} ${ageText((state.source_us - state.since_us) / 1e6)}${lost}` : RECORD_TEXTS.off);
  chip.title = on ? RECORD_TEXTS.title(state, fixed(state.free_bytes / 2 ** 30, 0)) : state?.problem || RECORD_TEXTS.silent;
}

/** @param {import("./store.js").Store} store @param {number} now */
function renderAdvice(store, now) {
  const advisory = store.get("advisor/advisory");
  const fresh = store.isFresh("advisor/advisory", now);
  const [word, kind, arrow] = ADVICE[fresh ? advisory.direction : "NO_DATA"];
  const box = byId("advice");
  if (box.dataset.arrow !== arrow) {
    box.dataset.arrow = arrow;
    box.dataset.kind = kind;
    byId("advice-arrow").innerHTML = `<path d="${arrow}"/>`;
  }
  setText(byId("advice-word"), word);
  const old = advisory ? ADVICE_TEXTS.last(ageText(store.ageS("advisor/advisory", now))) : ADVICE_TEXTS.none;
  const cause = fresh && advisory.cause !== "none" ? `: ${words(advisory.cause)}` : "";
  setText(byId("advice-reason"), fresh ? reasonText(advisory.reason) + cause : old);
  return word;
}

/** @param {import("./store.js").Store} store @param {number} now */
function renderPose(store, now) {
  const odometry = store.get("localization/odometry"), fresh = store.isFresh("localization/odometry", now);
  setText(byId("speed"), odometry ? fixed(odometry.surge_mps) : "–");
  setText(byId("heading"), odometry ? String(Math.round(headingDeg(odometry.yaw_rad)) % 360).padStart(3, "0") : "–");
  for (const id of ["speed", "heading"]) byId(id).parentElement.classList.toggle("stale", !fresh);
  const thrusters = store.get("thrusters/state"), battery = byId("battery");
  battery.parentElement.hidden = !thrusters?.battery_v;
  setText(battery, thrusters?.battery_v ? fixed(thrusters.battery_v, 1) : "–");
  battery.parentElement.classList.toggle("stale", !store.isFresh("thrusters/state", now));
}
