// @ts-check
// Texts and numbers as the page shows them. Pure.

/** @param {string} name */
export const words = (name) => name.toLowerCase().replaceAll("_", " ");

/** @param {string} text */
export const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** A reason code as text. @param {string} reason */
export const reasonText = (reason) => sentence(words(reason).replace(/^center/, "centre"));

/** Tracks by number as on the picture, "person #3". @param {{id: number, label: string}[]} tracks @param {number[]} ids */
export const trackNames = (tracks, ids) => ids.map((id) => `${tracks.find((track) => track.id === id)?.label ?? "track"} #${id}`).join(", ");

/** What kind of track it is. @param {any} track */
export const trackState = (track) => (track.immediate_danger ? "immediate" : track.accepted ? "accepted" : "tentative");

/** The label of a track, the same wherever it stands. @param {any} track */
export const trackLabel = (track) => `#${track.id} ${track.label} ${fixed(track.confidence)} ${trackState(track)}`;

/** @param {number} value @param {number} [digits] */
export const fixed = (value, digits = 2) => (Number.isFinite(value) ? value.toFixed(digits) : "–");

/** @param {number} seconds */
export function ageText(seconds) {
  if (!Number.isFinite(seconds)) return "never";
  return seconds < 10 ? `${seconds.toFixed(1)} s` : seconds < 120 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
}

/** True heading in degrees from a counter-clockwise angle from east. @param {number} yawRad */
export const headingDeg = (yawRad) => (((90 - (yawRad * 180) / Math.PI) % 360) + 360) % 360;

/** Reasons for zero thrust: inhibits of navigator and controller, and zero causes of the thrust adapter. @type {Record<string, string>} */
export const STOP_REASONS = {
  NOT_ARMED: "not armed",
  NO_CLOCK: "no time received from the boat",
  CLOCK_STOPPED: "the boat's clock has stopped",
  NO_ODOMETRY: "position unknown",
  STALE_ODOMETRY: "position too old",
  UNHEALTHY_ODOMETRY: "position estimate not healthy",
  NO_ADVISORY: "no advice yet",
  STALE_ADVISORY: "advice too old",
  ADVISED_STOP: "the advisor advises STOP",
  ADVISED_NO_DATA: "the advisor has no evidence",
  TURN_CAPPED: "turned as far as allowed without finding a clear direction",
  NO_FREE_PATH: "no trajectory is known to be free",
  NO_ROUTE: "no route",
  ROUTE_FINISHED: "route finished",
  HOLDING: "holding station",
  MISSION_DONE: "mission done",
  OUTSIDE_FENCE: "outside the fence, or too close to it",
  NO_ORDER: "no mode received from the operator's process",
  STALE_ORDER: "the operator's order is too old",
  IDLE: "idle: no mode that moves the boat is chosen",
  NEUTRAL: "the stick is in neutral",
  BLOCKED_AHEAD: "the advisor sees the way ahead blocked",
  WRONG_DOMAIN: "message from another domain",
  NO_COMMAND: "no command yet",
  STALE_COMMAND: "command too old",
  COMMAND_INVALID: "command not valid",
  no_command: "no thrust command yet",
  timeout: "thrust commands stopped coming",
  not_enabled: "the command does not enable thrust",
  not_armed: "not armed",
  line_lost: "no answer from the microcontroller of the thrusters",
  refused: "the microcontroller refuses the thrust",
  emergency_stop: "emergency stop pressed, or not yet cleared: release it, disarm, arm",
  receiver: "the radio receiver has taken over",
  battery_low: "battery low",
  over_current: "the thrusters draw too much current",
  rearm: "the microcontroller waits to be disarmed and armed again",
  arming_lost: "no message from the operator's console",
  pulse_lost: "a vital process sends no heartbeat",
  stale_echo: "thrust command too old",
  wrong_producer: "thrust command from another process",
  wrong_domain: "thrust command from another domain",
  old_epoch: "thrust command from an earlier run",
  replayed: "thrust command repeated",
  future: "thrust command from the future",
  invalid: "thrust command out of range",
};

/** What the boat does: word and kind. `activity.js` says which holds. @type {Record<string, [string, string]>} */
export const ACTIVITIES = {
  STOPPED: ["STOPPED", "stop"],
  NOT_ARMED: ["NOT ARMED", "none"],
  STANDING: ["STANDING STILL", "stop"],
  HOLDING: ["HOLDING", "go"],
  DONE: ["MISSION DONE", "none"],
  WAITING: ["WAITING", "turn"],
  LOOKING: ["LOOKING FOR A WAY", "turn"],
  AVOIDING: ["AVOIDING", "turn"],
  ROUTE: ["FOLLOWING ROUTE", "go"],
  STATION: ["GOING TO STATION", "go"],
  HOME: ["RETURNING HOME", "go"],
  UNDER_WAY: ["UNDER WAY", "go"],
  MANUAL: ["DRIVEN BY HAND", "turn"],
  IDLE: ["IDLE", "none"],
  REPLAY: ["RECORDING", "none"],
  UNKNOWN: ["UNKNOWN", "none"],
};

/** @type {Record<string, string>} */
export const PALETTES = { auto: "Auto", day: "Day", dusk: "Dusk", night: "Night" };

/** What an alert does besides standing in the log. @type {Record<string, string>} */
export const ALERTS = { off: "Silent", sound: "Sound", both: "Sound, vibration" };

/** Words of the editor on the map. @type {{kinds: Record<string, string>, acts: Record<string, string>} & Record<string, any>} */
export const EDITOR = {
  kinds: { follow_route: "Route", hold_station: "Hold", return_home: "Return", stop: "Stop", in: "Keep in", out: "Keep out" },
  acts: { undo: "Undo", point: "Delete point", item: "Delete leg", load: "In force", open: "Open file" },
  hint: "Press on the map to draw a route, add a leg or an area, or drop a file here.",
  fine: "Nothing is wrong with it as far as this page knows.",
  nothing: "No mission and no route is in force.",
  noOrigin: "where the map lies on Earth is not known yet",
  sent: "Sent; it is being checked.",
  accepted: "Accepted. It is in force; order Route to follow it.",
};

/** The map: what points up on it, and what a press on that does. */
export const MAP_TEXTS = {
  up: { north: "North", boat: "Bow" },
  turn: "North or the bow is up",
  tooFar: "Zoom in to see the chart",
  noTiles: "No tiles of the chart lie here",
  damagedTile: "the picture is damaged",
  drawing: "North is up while a mission is drawn",
  notHeard: "not heard for",
  nearest: (/** @type {number} */ cpaM, /** @type {number} */ afterS) => `nearest ${cpaM.toFixed(1)} m in ${afterS.toFixed(0)} s`,
};

/** What refuses a heading: its name, and a clause. `none`: nothing. @type {Record<string, [string, string]>} */
export const CONSTRAINTS = {
  none: ["free", ""],
  person: ["person", "too near to a person"],
  static_obstacle: ["standing obstacle", "too near to what stands there"],
  dynamic_obstacle: ["moving obstacle", "too near to what moves there"],
  unknown_water: ["unseen water", "no room to stop before water not seen yet"],
  wait: ["waits", "the boat waits until something has passed"],
  look: ["looks", "the boat looks where it turns before it moves"],
  no_escape: ["no way out", "does not lead out of a place without margin"],
  too_fast: ["too fast", "too fast beside an obstacle"],
  turn: ["turn", "no turn that may be made now"],
};

/** What a heading costs. @type {Record<string, string>} */
export const COSTS = {
  course: "off the course",
  progress: "little made good",
  heading_change: "off the plan before",
  advice: "not to the advised side",
  unknown_water: "unseen water on the way",
  proximity: "near obstacles",
  path_obstacle: "obstacle further along",
  margin: "into the margin",
};

/** The headings on the map. */
export const HEADING_TEXTS = {
  taken: "taken", free: "free", refused: "refused", costs: "costs", dearer: "dearer by",
  speeds: { fastest: "at the highest speed", between: "at the next", slowest: "at the lowest" },
  none: "No heading is weighed: there is no plan of the last second.",
  off: "No heading is weighed: the planner is off, and the boat turns as advised.",
};

/** Modes: name, and what the boat does in it. @type {Record<string, [string, string]>} */
export const MODE_TEXTS = {
  ROUTE: ["Route", "follows its mission or route"],
  HOLD: ["Hold", "keeps its station here"],
  RETURN: ["Return", "goes home, keeps station there"],
  MANUAL: ["Manual", "does what your hand says"],
  IDLE: ["Idle", "no thrust"],
};

/** Who holds the wheel. */
export const WHEEL_TEXTS = { unknown: "–", nobody: "nobody", thisPage: "this page", otherPage: "another page", silent: "no word from the operator's process", holds: "holds the wheel" };

/** Beside the button that arms. */
export const ARM_TEXTS = { hold: "Hold to arm", release: "Release to arm", armed: "Armed", stands: "Armed, the boat still stands:", nothing: "Nothing else keeps the boat still." };

/** Why a mode may not start, in a few words. @type {Record<string, string>} */
export const MODE_BARS = {
  NOT_HOLDER: "another hand holds the wheel",
  NO_POSITION: "position not known well enough",
  NO_HOME: "home not known yet",
  NO_MISSION: "no mission and no route",
  NOT_ARMED: "arm first",
};

/** What the thrust moves. @type {Record<string, string>} */
export const MODES = { sim: "SIM", hil: "HIL", hull: "HULL", replay: "REPLAY" };

/** Who stopped or armed the boat, by the name of the process. @type {Record<string, string>} */
const OPERATORS = { dashboard: "the page", stop: "paani stop", button: "the button", arm: "paani up", "": "an earlier run" };

/** @param {string} by */
export const operatorText = (by) => OPERATORS[by] ?? by;

/** Stages from the picture to the thrust gate, in order: name, and what is said of one that sends nothing. @type {Record<string, [string, string]>} */
export const STAGES = {
  camera: ["Camera", "no recent picture"],
  perception: ["Perception", "no recent evidence"],
  advisor: ["Advisor", "no recent advice"],
  localization: ["Position", "no recent position"],
  operator: ["Operator", "no word from the operator's process"],
  mission: ["Mission", ""],
  planner: ["Planner", ""],
  fence: ["Fence", ""],
  navigator: ["Navigator", "no recent order"],
  controller: ["Controller", "no recent thrust"],
  gate: ["Thrust adapter", "no recent report of thrust"],
};

/** The time of a moment, on this machine's clock. @param {number} us */
export const clockText = (us) => new Date(us / 1000).toTimeString().slice(0, 8);

/** A length of time as minutes and seconds. @param {number} us */
export const spanText = (us) => `${Math.floor(us / 60e6)}:${String(Math.floor((us % 60e6) / 1e6)).padStart(2, "0")}`;

/** The strip of time and its controls. */
export const TIME_TEXTS = {
  noServer: "no connection to the dashboard",
  past: "PAST",
  recording: "RECORDING",
  readOnly: "read-only",
  liveNow: "Live now",
  stillLive: "STOP still stops the boat",
  nothing: "nothing recorded yet",
  play: "Play",
  pause: "Pause",
  toLive: "Back to live",
  toReplayed: "Back to the replay",
  noBoat: "No boat is steered from this page",
  unknown: "unknown",
  loading: "loading",
};

/** The health tab. */
export const HEALTH_TEXTS = { log: "Log of", empty: "The log is empty.", cut: "Its last lines; those before are in the file." };

/** The topics tab. */
export const TOPICS_TEXTS = { freeze: "Freeze", thaw: "Frozen: go on", none: "Press a topic for its last value", silent: "nothing received" };

/** The health report that says at which rate each topic comes. */
export const HEALTH_INPUTS = "health/dashboard";

/** Fields of every message's header, which the tab of devices leaves out. */
export const DEVICE_FACTS = { header: ["source_us", "seq", "epoch", "domain", "producer", "sent_us", "steady_us", "topic", "devices"] };

/** The settings tab. */
export const SETTING_TEXTS = { tuned: "tuned", try: "Try", sent: "tried beside what is in force", none: "Nothing is tried. A value that judges can be tried beside the one in force, whose advice alone is obeyed.", of: "of" };

/** The recordings tab. */
export const RECORDING_TEXTS = {
  off: "Nothing is recorded here: recorder.folder is not set (paani up --record DIR).",
  reading: "reading", in: "in", none: "nothing is recorded there yet", leftOut: "older ones are not listed", running: "being written", protected: "protected",
  play: "Replay here", download: "Download", protect: "Protect", unprotect: "Unprotect", delete: "Delete", sure: "Press again to delete",
};

/** Plots over time: title with its unit, and the curves: column, name, colour. @type {[string, [string, string, string][]][]} */
export const PLOTS = [
  ["Speed [m/s]", [["speed_mps", "ahead", "--cyan"]]],
  ["Cross-track [m]", [["cross_track_m", "to port", "--route"]]],
  ["Risk", [["risk_left", "left", "--blue-text"], ["risk_center", "centre", "--orange"], ["risk_right", "right", "--green"]]],
  ["Thrust", [["thrust_left", "port", "--cyan"], ["thrust_right", "starboard", "--orange"]]],
  ["CPU [cores]", [["cpu_cores", "all processes", "--rose"]]],
  ["Picture to advice [ms]", [["latency_ms", "latency", "--amber"]]],
];

/** Set text only when it changes. @param {Element | null} element @param {string} text */
export function setText(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}

/**
 * A definition list of names, values and whether a value is bad.
 * @param {Element} list @param {[string, string, boolean][]} facts
 */
export function setFacts(list, facts) {
  if (list.children.length !== facts.length * 2) list.replaceChildren(...facts.flatMap(() => [make("dt"), make("dd")]));
  facts.forEach(([name, value, bad], index) => {
    setText(list.children[index * 2], name);
    setText(list.children[index * 2 + 1], value);
    list.children[index * 2 + 1].classList.toggle("bad", bad);
  });
}

/** @param {string} id @returns {any} */
export const byId = (id) => document.getElementById(id);

/** @param {string} tag @param {string} [className] @param {string} [text] */
export function make(tag, className = "", text = "") {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text) element.textContent = text;
  return element;
}
