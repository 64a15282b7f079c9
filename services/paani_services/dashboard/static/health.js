// @ts-check
// The health tab: one row per process with its state, rate, delays, age of its report, load, and what it dropped and why.

import { processLog, showProcessLog } from "./process_log.js";
import { cell, computed, html, mount, tableHead, tableMoment } from "./templates.js";
import { HEALTH_TEXTS, ageText, dropText, fixed, noteText } from "./text.js";

/** The main output of each process; its rate is shown. @type {Record<string, string>} */
const MAIN_TOPIC = {
  plant: "plant/thrust_applied", eye: "eye/picture", camera: "camera/picture", perception: "perception/evidence",
  advisor: "advisor/advisory", navigator: "navigator/command", controller: "controller/thrust",
  localization: "localization/odometry", operator: "operator/arming", dashboard: "operator/tuning", recorder: "recorder/state",
  bridge: "bridge/state", thrusters: "plant/thrust_applied", sensors: "sensors/imu",
};
/** What these send is made of no evidence whose age would tell how long they take. */
const MADE_OF_NOTHING = { dashboard: true, recorder: true };

/** @typedef {{name: string, isReady: boolean, cpuCores: number, cells: [string, string][]}} Process its cells: text and classes */

/** @type {{value: Process[]}} */
const processes = computed(() => {
  const { store } = tableMoment.value, services = /** @type {string[]} */ (store.get("dashboard/settings")?.services ?? []);
  const rates = new Map(services.flatMap((name) => store.get(`health/${name}`)?.inputs ?? []).map((input) => [input.topic, input]));
  return services.map((name) => readProcess(tableMoment.value, name, rates.get(MAIN_TOPIC[name])));
});

export function bindHealth() {
  mount("#tab-health", () => {
    const ready = processes.value.filter((each) => each.isReady).length, all = processes.value.length, cores = processes.value.reduce((sum, each) => sum + each.cpuCores, 0);
    const isCounted = all && tableMoment.value.store.get("dashboard/settings").mode !== "replay";
    return html`${HEALTH_TEXTS.title} <span id="health-sum" title=${all ? HEALTH_TEXTS.sumTitle(ready, all, fixed(cores, 2)) : ""}>${isCounted ? HEALTH_TEXTS.sum(ready, all) : ""}</span>`;
  });
  mount("[data-tab-panel=health]", () => html`
    <div class="panel health" tabindex="0" role="group" aria-label=${HEALTH_TEXTS.table}>
      <header><h2>${HEALTH_TEXTS.title}</h2><span class="quiet">${HEALTH_TEXTS.hint}</span></header>
      <table class="cards">${tableHead(HEALTH_TEXTS.columns, [2, 3, 4, 5, 6, 7, 8, 9, 10])}<tbody id="health">${processes.value.map(row)}</tbody></table>
    </div>${processLog.value}`);
}

/** @param {Process} process */
const row = ({ name, cells }) => html`<tr key=${name}><td><button type="button" onClick=${() => void showProcessLog(name)}>${name}</button></td>${cells.map(([text, kind], column) => cell(HEALTH_TEXTS.columns[column + 1], text, kind))}</tr>`;

/** @param {import("./templates.js").Moment} moment @param {string} name @param {any} input of its main topic @returns {Process} */
function readProcess({ store, now, isOpen }, name, input) {
  const report = store.get(`health/${name}`), life = store.get("dashboard/services")?.services.find((/** @type {any} */ each) => each.service === name);
  const isFresh = isOpen && store.isFresh(`health/${name}`, now), isReady = Boolean(isOpen && life?.alive && isFresh);
  const isRecorded = store.get("dashboard/settings").mode === "replay" && name !== "dashboard"; // it need not run
  const drops = (report?.drops ?? []).filter((/** @type {any} */ drop) => drop.count), stale = isFresh ? "" : " stale";
  const delays = name in MADE_OF_NOTHING ? [] : store.delaysMs(MAIN_TOPIC[name]);
  return {
    name, isReady, cpuCores: isReady ? report.cpu_cores : 0,
    cells: [
      isRecorded ? [isFresh ? HEALTH_TEXTS.recorded : HEALTH_TEXTS.notPlayed, "quiet"] : isReady ? [HEALTH_TEXTS.ready, "good"] : life?.alive && isOpen ? [HEALTH_TEXTS.silent, "bad"] : life?.starts ? [HEALTH_TEXTS.gone, "bad"] : [HEALTH_TEXTS.notStarted, "warn"],
      [input && (isReady || (isRecorded && isFresh)) ? `${fixed(input.rate_hz, input.rate_hz < 10 ? 1 : 0)} Hz` : "–", `${isReady && input && !input.rate_ok ? "warn number" : "number"}${stale}`],
      [delayText(delays, 0.5), "number"],
      [delayText(delays, 0.95), "number"],
      [report ? ageText(store.ageS(`health/${name}`, now)) : "–", `number${stale}`],
      [report ? `${fixed(report.cpu_cores * 100, 0)} %` : "–", `number${stale}`],
      [report ? fixed(report.rss_mib, 0) : "–", `number${stale}`],
      [report?.open_files ? String(report.open_files) : "–", `number${stale}`],
      [report?.temperature_c ? fixed(report.temperature_c, 0) : "–", `number${stale}`],
      [life ? String(life.starts) : "–", life?.starts > 1 ? "warn number" : "number"],
      [drops.length ? drops.map(dropText).join(", ") : report ? HEALTH_TEXTS.noDrops : "–", `${drops.length ? "warn wide" : "wide"}${stale}`],
      [noteText(report?.note ?? ""), "wide quiet"],
    ],
  };
}

/** A quantile of the time from what a message is made of until it was sent. @param {number[]} delaysMs @param {number} part */
const delayText = (delaysMs, part) => (delaysMs.length < 10 ? "–" : `${fixed([...delaysMs].sort((a, b) => a - b)[Math.floor((delaysMs.length - 1) * part)], 0)} ms`);
