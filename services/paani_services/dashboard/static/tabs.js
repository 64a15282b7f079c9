// @ts-check
// The tabs of the page. The first is the one people drive from; the bar, STOP and the strip of time stay on every one.

import { signal } from "./templates.js";

const DRIVE = "drive";

/** The tab that is shown. */
export const shownTab = signal(DRIVE);

/** Whether the tab is shown from which the boat is driven. */
export const isDriveTab = () => shownTab.value === DRIVE;

/** @param {string} name */
export function showTab(name) {
  shownTab.value = name;
  document.body.dataset.tab = name;
  for (const button of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-tab-of]"))) {
    if (button.dataset.tabOf === name) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  }
  for (const panel of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-tab-panel]"))) {
    panel.hidden = panel.dataset.tabPanel !== name;
  }
  scrollTo(0, 0);
}

export function bindTabs() {
  for (const button of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-tab-of]"))) {
    button.addEventListener("click", () => showTab(button.dataset.tabOf ?? DRIVE));
  }
  showTab(DRIVE);
}
