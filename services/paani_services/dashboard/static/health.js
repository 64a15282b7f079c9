// @ts-check
// The health tab: one row per process with its state, rate, delays, age of its report, load, and what it dropped and why.

import { bindProcessLog } from "./process_log.js";
import { HEALTH_TEXTS, ageText, byId, fixed, make, setText } from "./text.js";

/** The main output of each process; its rate is shown. @type {Record<string, string>} */
const MAIN_TOPIC = {
  plant: "plant/thrust_applied", eye: "eye/picture", camera: "camera/picture", perception: "perception/evidence",
  advisor: "advisor/advisory", navigator: "navigator/command", controller: "controller/thrust",
  localization: "localization/odometry", operator: "operator/arming", dashboard: "operator/tuning", recorder: "recorder/state",
  bridge: "bridge/state", thrusters: "plant/thrust_applied", sensors: "sensors/imu",
};
/** What these send is made of no evidence whose age would tell how long they take. */
const MADE_OF_NOTHING = { dashboard: true, recorder: true };
const COLUMNS = 13;
/** @type {Map<string, HTMLElement[]>} */
const cells = new Map();

/** @param {import("./store.js").Store} store @param {boolean} open @param {number} now */
export function renderHealth(store, open, now) {
  const settings = store.get("dashboard/settings");
  if (!settings) return;
  const liveness = new Map((store.get("dashboard/services")?.services ?? []).map((/** @type {any} */ life) => [life.service, life]));
  const rates = new Map();
  for (const name of settings.services) {
    for (const input of store.get(`health/${name}`)?.inputs ?? []) rates.set(input.topic, input);
  }
  let ready = 0, cpu = 0;
  for (const name of settings.services) {
    const report = store.get(`health/${name}`), life = liveness.get(name), fresh = open && store.isFresh(`health/${name}`, now);
    const alive = Boolean(open && life?.alive && fresh), input = rates.get(MAIN_TOPIC[name]);
    const drops = (report?.drops ?? []).reduce((/** @type {number} */ sum, /** @type {any} */ drop) => sum + drop.count, 0);
    ready += alive ? 1 : 0;
    cpu += alive ? report.cpu_cores : 0;
    const [, state, rate, middle, late, age, cores, memory, files, warmth, starts, dropped, says] = rowCells(name);
    const isRecorded = settings.mode === "replay" && name !== "dashboard"; // it need not run
    const [word, kind] = isRecorded ? [fresh ? HEALTH_TEXTS.recorded : HEALTH_TEXTS.notPlayed, "quiet"] : alive ? [HEALTH_TEXTS.ready, "good"] : life?.alive && open ? [HEALTH_TEXTS.silent, "bad"] : life?.starts ? [HEALTH_TEXTS.stopped, "bad"] : [HEALTH_TEXTS.notStarted, "warn"];
    const delays = name in MADE_OF_NOTHING ? [] : store.delaysMs(MAIN_TOPIC[name]);
    setText(state, word);
    state.className = kind;
    setText(rate, input && (alive || (isRecorded && fresh)) ? `${fixed(input.rate_hz, input.rate_hz < 10 ? 1 : 0)} Hz` : "–");
    rate.className = alive && input && !input.rate_ok ? "warn number" : "number";
    setText(age, report ? ageText(store.ageS(`health/${name}`, now)) : "–");
    setText(cores, report ? `${fixed(report.cpu_cores * 100, 0)} %` : "–");
    setText(memory, report ? fixed(report.rss_mib, 0) : "–");
    setText(middle, delayText(delays, 0.5));
    setText(late, delayText(delays, 0.95));
    setText(files, report?.open_files ? String(report.open_files) : "–");
    setText(warmth, report?.temperature_c ? fixed(report.temperature_c, 0) : "–");
    setText(dropped, drops ? report.drops.filter((/** @type {any} */ drop) => drop.count).map((/** @type {any} */ drop) => `${drop.cause} ${drop.count}`).join(", ") : report ? HEALTH_TEXTS.noDrops : "–");
    setText(says, report?.note ?? "");
    dropped.className = drops ? "warn wide" : "wide";
    setText(starts, life ? String(life.starts) : "–");
    starts.className = life?.starts > 1 ? "warn number" : "number";
    for (const cell of [rate, age, cores, memory, files, warmth, dropped]) cell.classList.toggle("stale", !fresh);
  }
  setText(byId("health-sum"), settings.mode === "replay" ? "" : HEALTH_TEXTS.sum(ready, settings.services.length));
  byId("health-sum").title = HEALTH_TEXTS.sumTitle(ready, settings.services.length, fixed(cpu, 2));
}

/** A quantile of the time from what a message is made of until it was sent. @param {number[]} delaysMs @param {number} part */
const delayText = (delaysMs, part) => (delaysMs.length < 10 ? "–" : `${fixed([...delaysMs].sort((a, b) => a - b)[Math.floor((delaysMs.length - 1) * part)], 0)} ms`);

/** @param {string} name */
function rowCells(name) {
  let found = cells.get(name);
  if (!found) {
    found = Array.from({ length: COLUMNS }, (_, index) => make("td", index > 1 && index < COLUMNS - 2 ? "number" : index === COLUMNS - 1 ? "wide quiet" : ""));
    const line = make("tr"), button = make("button", "", name);
    button.setAttribute("type", "button");
    bindProcessLog(button, name);
    found[0].append(button);
    line.append(...found);
    byId("health").append(line);
    cells.set(name, found);
  }
  return found;
}
