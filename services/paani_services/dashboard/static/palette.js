// @ts-check
// The palette: day, dusk or night, or day and dusk as the system says. Kept in this browser.

import { PALETTES, byId, setText } from "./text.js";

const KEY = "paani-palette", light = matchMedia("(prefers-color-scheme: light)");
const names = Object.keys(PALETTES);
let chosen = localStorage.getItem(KEY) ?? "auto";

function apply() {
  document.documentElement.dataset.palette = chosen !== "auto" ? chosen : light.matches ? "day" : "dusk";
  setText(byId("palette-name"), PALETTES[chosen]);
}

export function nextPalette() {
  chosen = names[(names.indexOf(chosen) + 1) % names.length];
  localStorage.setItem(KEY, chosen);
  apply();
}

export function bindPalette() {
  light.addEventListener("change", apply);
  byId("palette")?.addEventListener("click", nextPalette);
  apply();
}
