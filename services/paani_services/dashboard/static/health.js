// @ts-check
// The health panel: one row per process with its state, rate, age of its report, load and dropped messages.

import { ageText, byId, fixed, make, setText } from "./text.js";

/** The main output of each process; its rate is shown. @type {Record<string, string>} */
const MAIN_TOPIC = {
  plant: "plant/thrust_applied", eye: "eye/picture", camera: "camera/picture", perception: "perception/evidence",
  advisor: "advisor/advisory", navigator: "navigator/command", controller: "controller/thrust",
  localization: "localization/odometry", operator: "operator/arming", dashboard: "operator/tuning", recorder: "recorder/state",
  bridge: "bridge/state", thrusters: "plant/thrust_applied", sensors: "sensors/imu",
};
const COLUMNS = 8;
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
    const [service, state, rate, age, cores, memory, dropped, starts] = rowCells(name);
    const isRecorded = settings.mode === "replay" && name !== "dashboard"; // it need not run
    const [word, kind] = isRecorded ? [fresh ? "recorded" : "not played", "quiet"] : alive ? ["ready", "good"] : life?.alive && open ? ["no report", "bad"] : life?.starts ? ["stopped", "bad"] : ["not started", "warn"];
    setText(service, name);
    setText(state, word);
    state.className = kind;
    setText(rate, input && (alive || (isRecorded && fresh)) ? `${fixed(input.rate_hz, input.rate_hz < 10 ? 1 : 0)} Hz` : "–");
    rate.className = alive && input && !input.rate_ok ? "warn" : "";
    setText(age, report ? ageText(store.ageS(`health/${name}`, now)) : "–");
    setText(cores, report ? `${fixed(report.cpu_cores * 100, 0)} %` : "–");
    setText(memory, report ? fixed(report.rss_mib, 0) : "–");
    setText(dropped, report ? String(drops) : "–");
    dropped.className = drops ? "warn" : "";
    setText(starts, life ? String(life.starts) : "–");
    starts.className = life?.starts > 1 ? "warn" : "";
    service.title = report?.note ?? "";
    dropped.title = (report?.drops ?? []).map((/** @type {any} */ drop) => `${drop.cause}: ${drop.count}`).join(", ");
    for (const cell of [rate, age, cores, memory, dropped]) cell.classList.toggle("stale", !fresh);
  }
  setText(byId("health-sum"), settings.mode === "replay" ? "of the recorded drive" : `${ready} of ${settings.services.length} ready, ${fixed(cpu, 2)} cores`);
}

/** @param {string} name */
function rowCells(name) {
  let found = cells.get(name);
  if (!found) {
    found = Array.from({ length: COLUMNS }, () => make("td"));
    const line = make("tr");
    line.append(...found);
    byId("health").append(line);
    cells.set(name, found);
  }
  return found;
}
