// @ts-check
// Sound and vibration for what happens while nobody looks: silent until somebody asks for it, kept in this browser.

import { ALERTS, byId, setText } from "./text.js";

const KEY = "paani-alerts", REPEAT_MS = 3000, PAUSE_MS = 1500, MAX_AGE_MS = 2000;
/** Tones of a level: frequency [Hz] and length [s] each; and the vibration [ms]. @type {Record<string, [[number, number][], number[]]>} */
const SIGNALS = {
  stop: [[[520, 0.22], [390, 0.34]], [250, 120, 250]],
  warn: [[[660, 0.16]], [120]],
  lost: [[[440, 0.15], [440, 0.15], [440, 0.3]], [400, 150, 400]],
};
const names = Object.keys(ALERTS);
let chosen = localStorage.getItem(KEY) ?? "off", givenAt = -PAUSE_MS, lostAt = -REPEAT_MS;
/** @type {AudioContext | null} */
let audio = null;

export function bindAlerts() {
  const button = byId("alerts");
  button.addEventListener("click", () => {
    chosen = names[(names.indexOf(chosen) + 1) % names.length];
    localStorage.setItem(KEY, chosen);
    show();
    if (chosen !== "off") signal("warn");
  });
  show();
}

const show = () => setText(byId("alerts-name"), ALERTS[chosen] ?? ALERTS.off);

/** Give the signal of a line of the log, unless it happened before this page was open. @param {string} level @param {number} ageMs */
export function alertOf(level, ageMs) {
  if (level in SIGNALS && ageMs <= MAX_AGE_MS) give(level, performance.now());
}

/** While the link is lost, again and again. @param {number} now */
export function alertOfLink(now) {
  if (document.body.dataset.link !== "lost" || now - lostAt < REPEAT_MS) return;
  lostAt = now;
  give("lost", now);
}

/** @param {string} level @param {number} now */
function give(level, now) {
  if (chosen === "off" || (now - givenAt < PAUSE_MS && level === "warn")) return;
  givenAt = now;
  signal(level);
}

/** @param {string} level */
function signal(level) {
  const [tones, vibration] = SIGNALS[level];
  if (chosen === "both") navigator.vibrate?.(vibration);
  audio ??= new AudioContext(); // a browser lets it sound after the first press on the page
  void audio.resume();
  let at = audio.currentTime;
  for (const [frequency, length] of tones) {
    const tone = audio.createOscillator(), volume = audio.createGain();
    tone.frequency.value = frequency;
    volume.gain.setValueAtTime(0.25, at);
    volume.gain.exponentialRampToValueAtTime(0.001, at + length);
    tone.connect(volume).connect(audio.destination);
    tone.start(at);
    tone.stop(at + length);
    at += length;
  }
}
