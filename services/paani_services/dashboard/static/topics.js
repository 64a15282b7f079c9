// @ts-check
// The topics tab: every topic with its rate, age and size, its last value, a search, and a freeze.

import { shownTab } from "./tabs.js";
import { effect, html, mount, signal, tableHead, tableMoment } from "./templates.js";
import { HEALTH_INPUTS, TOPICS_TEXTS, ageText, fixed } from "./text.js";

const search = signal(""), chosen = signal(""), isFrozen = signal(false);
/** @type {{value: {name: string, producer: string, rate: string, age: string, size: string, isStale: boolean, value: any}[]}} */
const rows = signal([]);

export function bindTopics() {
  effect(() => {
    if (shownTab.value === "topics" && !isFrozen.value) rows.value = readTopics(tableMoment.value);
  });
  mount("[data-tab-panel=topics]", view);
}

/** @param {import("./templates.js").Moment} moment */
function readTopics({ store, now }) {
  const inputs = new Map((store.get(HEALTH_INPUTS)?.inputs ?? []).map((/** @type {any} */ input) => [input.topic, input]));
  const nominal = new Map((store.get("dashboard/settings")?.topics ?? []).map((/** @type {any} */ topic) => [topic.name, topic]));
  return [...new Set([...nominal.keys(), ...store.entries.keys()])].sort().map((name) => {
    const entry = store.entries.get(name), topic = nominal.get(name), input = inputs.get(name);
    return {
      name, value: entry?.value, isStale: !store.isFresh(name, now), age: entry ? ageText(store.ageS(name, now)) : "–", size: entry ? sizeText(entry.bytes) : "–",
      producer: topic?.producer ?? (name.startsWith("health/") ? name.slice(7) : "dashboard"),
      rate: input ? `${fixed(input.rate_hz, 1)}${topic ? ` / ${topic.rate_hz}` : ""}` : "–",
    };
  });
}

function view() {
  const text = search.value.trim().toLowerCase(), found = rows.value.filter(({ name, producer }) => `${name} ${producer}`.toLowerCase().includes(text));
  const value = rows.value.find(({ name }) => name === chosen.value)?.value;
  return html`
    <div class="panel">
      <header><h2>${TOPICS_TEXTS.title}</h2><span id="topics-sum" class="quiet">${TOPICS_TEXTS.sum(found.length, rows.value.length)}</span>
        <input id="topics-search" type="search" placeholder=${TOPICS_TEXTS.search} aria-label=${TOPICS_TEXTS.searchLabel} onInput=${(/** @type {any} */ event) => { search.value = event.target.value; }} />
        <button id="topics-freeze" type="button" aria-pressed=${isFrozen.value} onClick=${() => { isFrozen.value = !isFrozen.value; }}>${isFrozen.value ? TOPICS_TEXTS.thaw : TOPICS_TEXTS.freeze}</button></header>
      <div class="scroll" tabindex="0" role="group" aria-label=${TOPICS_TEXTS.table}><table>${tableHead(TOPICS_TEXTS.columns, [2, 3, 4])}<tbody id="topics">${found.map(row)}</tbody></table></div>
    </div>
    <div class="panel"><header><h2 id="topic-name">${chosen.value || TOPICS_TEXTS.none}</h2></header>
      <pre id="topic-value" tabindex="0" role="group" aria-label=${TOPICS_TEXTS.value}>${!chosen.value ? "" : value ? JSON.stringify(value, null, 2) : TOPICS_TEXTS.silent}</pre></div>`;
}

/** @param {{name: string, producer: string, rate: string, age: string, size: string, isStale: boolean}} topic */
const row = ({ name, producer, rate, age, size, isStale }) => html`<tr key=${name} class=${isStale ? "stale" : ""} aria-selected=${name === chosen.value}>
  <td><button type="button" onClick=${() => { chosen.value = name; }}>${name}</button></td><td class="quiet">${producer}</td><td class="number">${rate}</td><td class="number">${age}</td><td class="number">${size}</td></tr>`;

/** @param {number} bytes */
export const sizeText = (bytes) => (bytes < 1000 ? `${bytes} B` : bytes < 1e6 ? `${fixed(bytes / 1000, 1)} kB` : bytes < 1e9 ? `${fixed(bytes / 1e6, 1)} MB` : `${fixed(bytes / 1e9, 2)} GB`);
