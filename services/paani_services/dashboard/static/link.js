// @ts-check
// The link: age of the newest message from the boat. A loss stays red until somebody has seen it.

import { isReplay } from "./inhibits.js";
import { ageText, byId, fixed, setText } from "./text.js";

const LINK_TIMEOUT_S = 1.5;
let longestLossS = 0, lostAt = "";

export function bindLink() {
  byId("link-seen").addEventListener("click", () => { longestLossS = 0; });
}

/** @param {import("./store.js").Store} store @param {boolean} open @param {number} now */
export function renderLink(store, open, now) {
  const silenceS = store.silenceS(now), never = silenceS === Infinity, isOver = isReplay(store) && open;
  const silent = !never && (!open || silenceS > LINK_TIMEOUT_S), lost = silent && !isOver;
  if (lost && !longestLossS) lostAt = new Date().toTimeString().slice(0, 8);
  if (lost) longestLossS = Math.max(longestLossS, silenceS);
  const unseen = !lost && longestLossS > 0;
  document.body.dataset.link = lost ? "lost" : never ? "waiting" : silent ? "ended" : "live";
  document.body.dataset.loss = unseen ? "unseen" : "";
  byId("link-seen").hidden = !unseen;
  const isFile = open && Boolean(store.get("dashboard/settings")?.replayed);
  setText(byId("link-word"), isFile ? "replay" : lost ? `LOST ${ageText(silenceS)}` : never ? "waiting" : silent ? "not playing" : `live ${fixed(silenceS, 1)} s`);
  setText(byId("link-age"), unseen ? `was lost ${ageText(longestLossS)}, ${lostAt}` : !open ? "no connection" : isFile ? "of a file" : silent ? "no data" : never ? "for data" : "age of data");
  document.title = lost ? "LOST · PAANI" : "PAANI";
}
