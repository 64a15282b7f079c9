// @ts-check
// The link: age of the newest message from the boat. A loss stays red until somebody has seen it.

import { isReplay } from "./inhibits.js";
import { LINK_TEXTS, ageText, byId, fixed, setText } from "./text.js";

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
  setText(byId("link-word"), isFile ? LINK_TEXTS.replay : lost ? `${LINK_TEXTS.lost} ${ageText(silenceS)}` : never ? LINK_TEXTS.waiting : silent ? LINK_TEXTS.notPlaying : `${LINK_TEXTS.live} ${fixed(silenceS, 1)} s`);
  setText(byId("link-age"), unseen ? `${LINK_TEXTS.wasLost} ${ageText(longestLossS)}, ${lostAt}` : !open ? LINK_TEXTS.noConnection : isFile ? LINK_TEXTS.ofFile : silent ? LINK_TEXTS.noData : never ? LINK_TEXTS.forData : LINK_TEXTS.age);
  document.title = lost ? `${LINK_TEXTS.lost} · PAANI` : "PAANI";
}
