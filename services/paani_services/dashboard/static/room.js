// @ts-check
// Tells the styles how high the bar and the drive panel are, which depends on what they say: what one drives by shares
// the rest of the screen.

import { byId } from "./text.js";

export function bindRoom() {
  const parts = { "--bar": /** @type {HTMLElement} */ (document.querySelector(".bar")), "--drive": /** @type {HTMLElement} */ (byId("drive")) };
  const observer = new ResizeObserver(() => {
    for (const [name, part] of Object.entries(parts)) document.documentElement.style.setProperty(name, `${part.offsetHeight}px`);
  });
  for (const part of Object.values(parts)) observer.observe(part, { box: "border-box" });
}
