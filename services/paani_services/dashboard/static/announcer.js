// @ts-check
// What a screen reader is told: the boat's activity and the advice, once they have stayed as they are.

import { byId, setText } from "./text.js";

const SETTLED_MS = 700; // a state that flaps faster is not spoken
const PAUSE_MS = 3000; // between two announcements; a stop waits for none

let candidate = "", since = 0, spokenAt = -PAUSE_MS;

/** @param {string} text @param {boolean} isUrgent @param {number} now */
export function announce(text, isUrgent, now) {
  if (text !== candidate) {
    candidate = text;
    since = now;
  }
  const isDue = isUrgent || (now - since >= SETTLED_MS && now - spokenAt >= PAUSE_MS);
  if (!isDue || byId("announcer").textContent === text) return;
  spokenAt = now;
  setText(byId("announcer"), text);
}
