// @ts-check
// The topics tab: every topic with its rate, age and size, its last value, a search, and a freeze.

import { HEALTH_INPUTS, TOPICS_TEXTS, ageText, byId, fixed, make, setText } from "./text.js";

const PERIOD_MS = 500; // people read a table no faster
let isFrozen = false, chosen = "", renderedAt = -PERIOD_MS;
/** @type {Map<string, {row: HTMLElement, cells: HTMLElement[]}>} */
const rows = new Map();

export function bindTopics() {
  const freeze = byId("topics-freeze");
  freeze.addEventListener("click", () => {
    isFrozen = !isFrozen;
    freeze.setAttribute("aria-pressed", String(isFrozen));
    setText(freeze, isFrozen ? TOPICS_TEXTS.thaw : TOPICS_TEXTS.freeze);
  });
  byId("topics-search").addEventListener("input", () => { renderedAt = -PERIOD_MS; filter(); });
}

/** @param {import("./store.js").Store} store @param {number} now @param {number} present */
export function renderTopics(store, now, present) {
  if (isFrozen || present - renderedAt < PERIOD_MS) return;
  renderedAt = present;
  const inputs = new Map((store.get(HEALTH_INPUTS)?.inputs ?? []).map((/** @type {any} */ input) => [input.topic, input]));
  const nominal = new Map((store.get("dashboard/settings")?.topics ?? []).map((/** @type {any} */ topic) => [topic.name, topic]));
  for (const name of [...new Set([...nominal.keys(), ...store.entries.keys()])].sort()) {
    const { cells, row } = rowOf(name), entry = store.entries.get(name), topic = nominal.get(name), input = inputs.get(name);
    const [, producer, rate, age, size] = cells;
    setText(producer, topic?.producer ?? (name.startsWith("health/") ? name.slice(7) : "dashboard"));
    setText(rate, input ? `${fixed(input.rate_hz, 1)}${topic ? ` / ${topic.rate_hz}` : ""}` : "–");
    setText(age, entry ? ageText(store.ageS(name, now)) : "–");
    setText(size, entry ? sizeText(entry.bytes) : "–");
    row.classList.toggle("stale", !entry || !store.isFresh(name, now));
  }
  filter();
  renderValue(store);
}

/** @param {import("./store.js").Store} store */
function renderValue(store) {
  const entry = store.entries.get(chosen);
  setText(byId("topic-name"), chosen || TOPICS_TEXTS.none);
  setText(byId("topic-value"), !chosen ? "" : entry ? JSON.stringify(entry.value, null, 2) : TOPICS_TEXTS.silent);
}

function filter() {
  const text = byId("topics-search").value.trim().toLowerCase();
  let shown = 0;
  for (const [name, { row, cells }] of rows) {
    row.hidden = Boolean(text) && !`${name} ${cells[1].textContent}`.toLowerCase().includes(text);
    row.setAttribute("aria-selected", String(name === chosen));
    shown += row.hidden ? 0 : 1;
  }
  setText(byId("topics-sum"), TOPICS_TEXTS.sum(shown, rows.size));
}

/** @param {string} name */
function rowOf(name) {
  let found = rows.get(name);
  if (!found) {
    const row = make("tr"), cells = ["", "quiet", "number", "number", "number"].map((kind) => make("td", kind)), button = make("button", "", name);
    button.setAttribute("type", "button");
    button.addEventListener("click", () => {
      chosen = name;
      renderedAt = -PERIOD_MS;
      filter();
    });
    cells[0].append(button);
    row.append(...cells);
    const after = [...rows.keys()].filter((other) => other < name).sort().at(-1);
    if (after) rows.get(after)?.row.after(row);
    else byId("topics").prepend(row);
    found = { row, cells };
    rows.set(name, found);
  }
  return found;
}

/** @param {number} bytes */
export const sizeText = (bytes) => (bytes < 1000 ? `${bytes} B` : bytes < 1e6 ? `${fixed(bytes / 1000, 1)} kB` : bytes < 1e9 ? `${fixed(bytes / 1e6, 1)} MB` : `${fixed(bytes / 1e9, 2)} GB`);
