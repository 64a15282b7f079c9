// @ts-check
// The settings tab: every setting with its default, range and where it comes from; and the tuning step, with what the
// shadow policy would have advised.

import { ask } from "./past_source.js";
import { hasKey, post } from "./requests.js";
import { SETTING_TEXTS, byId, make, setText } from "./text.js";
import { changesText, countsText } from "./tuning.js";

/** @typedef {{path: string, value: string, default: string, origin: string, unit: string, limits: string, tunable: boolean}} Setting */

/** @type {Map<string, {setting: Setting, row: HTMLElement}>} */
const rows = new Map();
let isChangedOnly = false, proposal = "", active = "";

export function bindSettings() {
  document.querySelector('[data-tab-of="settings"]')?.addEventListener("click", () => void load());
  byId("settings-search").addEventListener("input", filter);
  byId("settings-changed").addEventListener("click", () => {
    isChangedOnly = !isChangedOnly;
    byId("settings-changed").setAttribute("aria-pressed", String(isChangedOnly));
    filter();
  });
  byId("settings-promote").addEventListener("click", () => void act("promote", { proposal }));
  byId("settings-rollback").addEventListener("click", () => void act("rollback", { proposal: proposal || active }));
}

async function load() {
  if (rows.size) return;
  try {
    for (const setting of await (await ask("/api/settings")).json()) rows.set(setting.path, { setting, row: rowOf(setting) });
    byId("settings").replaceChildren(...[...rows.values()].map(({ row }) => row));
    filter();
  } catch (error) {
    say(String(error instanceof Error ? error.message : error));
  }
}

/** @param {Setting} setting */
function rowOf(setting) {
  const row = make("tr"), trial = make("td");
  row.append(...[setting.path, setting.value, setting.unit, setting.default, setting.limits, setting.origin].map((text, index) => make("td", index === 1 || index === 3 ? "wide" : index > 3 ? "quiet" : "", text === "-" ? "–" : text)), trial);
  if (!setting.tunable) return row;
  const field = make("input"), button = make("button", "", SETTING_TEXTS.try);
  Object.assign(field, { value: setting.value, size: 7 });
  field.setAttribute("aria-label", `${SETTING_TEXTS.try} ${setting.path}`);
  button.setAttribute("type", "button");
  button.addEventListener("click", () => void act("propose", { changes: [{ path: setting.path, value: /** @type {HTMLInputElement} */ (field).value.trim() }] }));
  trial.append(field, " ", button);
  return row;
}

/** @param {string} what @param {object} body */
async function act(what, body) {
  if (hasKey()) say(await post(`/api/tune/${what}`, body));
}

/** @param {import("./store.js").Store} store @param {number} now */
export function renderSettings(store, now) {
  const shadow = store.isFresh("advisor/shadow", now) ? store.get("advisor/shadow") : undefined;
  proposal = shadow?.proposal ?? "";
  active = shadow?.active ?? "";
  byId("settings-promote").disabled = !proposal;
  byId("settings-rollback").disabled = !proposal && !active;
  setText(byId("settings-trial"), proposal ? `${proposal} ${SETTING_TEXTS.sent}: ${changesText(shadow.changes)}. ${countsText(shadow)}` : SETTING_TEXTS.none);
  const tuned = new Map((shadow?.active_changes ?? []).map((/** @type {any} */ change) => [change.path, change.value]));
  for (const [path, { setting, row }] of rows) {
    setText(row.children[1], tuned.get(path) ?? setting.value);
    setText(row.children[5], tuned.has(path) ? SETTING_TEXTS.tuned : setting.origin);
    row.dataset.changed = String(tuned.has(path) || setting.origin !== "default");
    row.children[5].className = row.dataset.changed === "true" ? "warn" : "quiet";
  }
}

function filter() {
  const text = byId("settings-search").value.trim().toLowerCase();
  let shown = 0;
  for (const [path, { row }] of rows) {
    row.hidden = !path.includes(text) || (isChangedOnly && row.dataset.changed !== "true");
    shown += row.hidden ? 0 : 1;
  }
  setText(byId("settings-sum"), `${shown} ${SETTING_TEXTS.of} ${rows.size}`);
}

/** @param {string} text */
function say(text) {
  setText(byId("settings-note"), text);
  byId("settings-note").dataset.bad = String(Boolean(text));
}
