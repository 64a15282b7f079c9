// @ts-check
// What draws the lists and forms of the page: templates, and the signals that have them drawn again. The server gives the
// library's files the address of this one, whichever folder they lie in.

import htm from "./htm.mjs";
import { h, render } from "./preact.mjs";
import { effect, signal } from "./signals-core.mjs";
import { Store } from "./store.js";

export { computed, effect, signal } from "./signals-core.mjs";

/** @typedef {{store: Store, now: number, isOpen: boolean}} Moment what is known, when, and whether more of it is heard */

const TABLE_PERIOD_MS = 500; // people read a table no faster
const NOTHING = { store: new Store(), now: 0, isOpen: false };
/** What the panels show, what the tables of the other tabs show, and the present, which may be neither. @type {{value: Moment}} */
export const moment = signal(NOTHING), tableMoment = signal(NOTHING), present = signal(NOTHING);
let tablesAt = -TABLE_PERIOD_MS;

/** @param {Moment} shown @param {Moment} live @param {boolean} isDrive whether the panels are seen */
export function showMoment(shown, live, isDrive) {
  present.value = live;
  if (shown.store !== tableMoment.value.store || live.now - tablesAt >= TABLE_PERIOD_MS) {
    tablesAt = live.now;
    tableMoment.value = shown;
  }
  if (isDrive) moment.value = shown;
}

export const html = htm.bind(h);

/** Draw a view into an element, and again whenever a signal that it reads changes. @param {string} selector @param {() => any} view */
export function mount(selector, view) {
  const element = /** @type {HTMLElement} */ (document.querySelector(selector));
  effect(() => render(view(), element));
}

/** A table's head. @param {string[]} names @param {number[]} [numbers] the columns of numbers */
export const tableHead = (names, numbers = []) => html`<thead><tr>${names.map((name, column) => html`<th class=${numbers.includes(column) ? "number" : ""}>${name}</th>`)}</tr></thead>`;

/** A cell that says its column's name where the table is drawn as cards, since a phone has no room for its columns. @param {string} name @param {any} value @param {string} [kind] */
export const cell = (name, value, kind = "") => html`<td class=${kind} data-column=${name}>${value}</td>`;

/** Names, values, and whether a value is bad. @param {[string, any, boolean?][]} list */
export const facts = (list) => list.map(([name, value, isBad]) => html`<dt>${name}</dt><dd class=${isBad ? "bad" : ""}>${value}</dd>`);
