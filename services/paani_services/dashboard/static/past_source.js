// @ts-check
// Drives of the past on the server, to be played.

import { unpackFrames } from "./frames.js";
import { Series } from "./series.js";
import { TIME_TEXTS } from "./text.js";

const MAX_SAMPLES = 600;

/** The answer to a request; throws an error with the server's reason, and its status as the cause. @param {string} path */
export async function ask(path) {
  const answer = await fetch(path).catch(() => null);
  if (!answer) throw new Error(TIME_TEXTS.noServer);
  if (!answer.ok) throw new Error(String((await answer.json()).error), { cause: answer.status });
  return answer;
}

/** @param {string} path @param {number} fromUs @param {number} toUs */
async function fetchFrames(path, fromUs, toUs) {
  const answer = await ask(`${path}?from_us=${Math.max(0, fromUs)}&to_us=${Math.max(0, toUs)}`);
  return unpackFrames(await answer.arrayBuffer()).map((frame) => ({ ...frame, atUs: frame.header.at_us ?? 0 }));
}

/** The last ten minutes. @returns {import("./playback.js").Source} */
export function historySource() {
  const path = "/api/history/frames";
  return { name: "", series: new Series(MAX_SAMPLES), isKeyframed: true, fetch: (fromUs, toUs) => fetchFrames(path, fromUs, toUs) };
}

/** Load what the server has of the last ten minutes. @param {Series} series */
export async function loadHistory(series) {
  series.load(await (await ask("/api/history")).json());
}

/** A recording of the recorder's folder; throws an error with the server's reason. @param {string} name */
export const recordingSource = (name) => sourceAt(`/api/recordings/${encodeURIComponent(name)}`, name);

/** The recording that the page plays instead of the present; throws an error with the server's reason. @param {string} name */
export const replayedSource = (name) => sourceAt("/api/replayed", name);

/** A recording, with its samples and events. @param {string} path @param {string} name @returns {Promise<import("./playback.js").Source>} */
async function sourceAt(path, name) {
  const series = new Series();
  series.load(await (await ask(`${path}/series`)).json());
  return { name, series, isKeyframed: false, fetch: (fromUs, toUs) => fetchFrames(`${path}/frames`, fromUs, toUs) };
}
