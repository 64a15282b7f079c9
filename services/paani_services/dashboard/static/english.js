// @ts-check
// All the words of the page and of its login, and nothing else: a translation is another file like this one.

/** What stands on the page from the beginning: by the names in index.html and login.html. @type {Record<string, string>} */
export const PAGE_TEXTS = {
  colours_d: "Colours (D)", signals_of_alerts: "Signals of alerts", what_the_boat_does: "What the boat does", advice: "Advice", tabs: "Tabs", moment_shown: "Moment shown",
  tuning: "Tuning", drive: "Drive", modes: "Modes", stick: "Stick: hold and pull; letting go is zero thrust", camera: "Camera", overlays: "Overlays",
  top_edge_title: "Upper edge of the corridors", own_hull_title: "What the own hull covers of the picture", camera_canvas: "Newest picture with overlay", tracks: "Tracks",
  motion: "Motion", explanation: "Explanation", map: "Map", headings_title: "Why this heading and no other", mission_editor: "Mission editor", legs_and_areas: "Legs and areas",
  gpx_or_geojson_file: "GPX or GeoJSON file", headings_group: "Headings that the planner weighed",
  map_canvas: "Fence, land, mission, route, way ahead, moving obstacles, estimated and true track, in metres east and north", map_controls: "Which way is up, and how large",
  zoom_in: "Zoom in", zoom_out: "Zoom out", log: "Log", health: "Health", recordings: "Recordings", topics: "Topics", settings: "Settings",
  sensors_and_bridge: "Sensors and bridge", plots_group: "Plots of the last ten minutes", time: "Time", playback: "Playback", step_back: "Step back",
  step_back_key: "Step back (,)", play: "Play", play_or_pause_k: "Play or pause (K)", step_forward: "Step forward", step_forward_key: "Step forward (.)", speed: "Speed",
  strip: "Moment shown: advice, mode, alerts and latency over the last ten minutes", colours: "Colours:", auto: "Auto", alerts: "Alerts:", silent: "Silent", log_out: "Log out",
  waiting: "waiting", seen: "Seen", unknown: "UNKNOWN", no_connection_yet: "no connection yet", no_data: "NO DATA", no_advice_received_yet: "no advice received yet",
  metres_per_second: "m/s", heading: "Heading", degrees_true: "° true", wheel: "Wheel", battery: "Battery", volts: "V", hold_to_arm: "Hold to arm", stop: "STOP", space: "space",
  back_to_live: "Back to live", take_the_wheel: "Take the wheel", how_to_steer: "or arrows, a gamepad, or hold the stick. Letting go is zero thrust.",
  override: "Override the advice for 10 s", mask: "Mask", boxes: "Boxes", corridors: "Corridors", top_edge: "Top edge", own_hull: "Own hull", opacity: "Opacity", water: "water",
  obstacle: "obstacle", sky: "sky", accepted: "accepted", not_seen_now: "not seen now", immediate_danger: "immediate danger", edit: "Edit", follow: "Follow", route: "Route",
  headings: "Headings", repeat: "repeat", laps: "laps", radius: "radius", metres: "m", for: "for", seconds: "s", speed_field: "speed", send: "Send", taken: "Taken", up: "Up:",
  north: "North", route_line: "route", fence: "fence", land: "land", way_ahead: "way ahead", moving: "moving", estimated_track: "track", true_track: "true track", plots: "Plots",
  mode: "Mode", alerts_row: "Alerts", latency: "Latency", the_operator_key_which: "The operator's key, which", paani_up: "paani up", prints: "prints", log_in: "Log in",
  stops_the_boat_at_once: "Stops the boat at once, without login.",
};

/** What the boat does and why, beside what the processes say. */
export const ACTIVITY_TEXTS = {
  wasUnderWay: "the boat was under way", stoodStill: "the boat stood still", noOrder: "no order is heard", neutral: "the stick is in neutral",
  nothingElse: "nothing else keeps the boat still", overridden: "the advice is overridden", vetoed: "the advice gives no thrust ahead", by: "by", turning: "turning",
  waitsFor: "for", noThrust: "no thrust ahead is ordered", plannedFor: "planned for",
  stoppedBy: (/** @type {string} */ who) => `by ${who}; arming releases it`,
  waypoint: (/** @type {number} */ next, /** @type {number} */ all) => `waypoint ${next} of ${all}`,
};

/** The advice. */
export const ADVICE_TEXTS = {
  words: /** @type {Record<string, string>} */ ({ STRAIGHT: "STRAIGHT", SLIGHT_LEFT: "SLIGHT LEFT", SLIGHT_RIGHT: "SLIGHT RIGHT", LEFT: "LEFT", RIGHT: "RIGHT", STOP: "STOP", NO_DATA: "NO DATA" }),
  none: "No advice received yet",
  last: (/** @type {string} */ age) => `Last advice ${age} ago`,
  announced: (/** @type {string} */ activity, /** @type {string} */ advice) => `${activity}. Advice: ${advice}.`,
};

/** The camera. */
export const CAMERA_TEXTS = {
  noneThen: "No picture of this moment", frame: "frame", of: "of", gaps: "Pictures come with gaps", noEvidence: "No evidence for this frame: overlay left out", unusable: "Picture unusable",
  last: (/** @type {string} */ age) => `Last picture ${age} ago`,
};

/** The explanation and the tracks. `steps`: of the decision. */
export const EXPLANATION_TEXTS = {
  title: PAGE_TEXTS.explanation, path: "Steps of the decision", inputTitle: "Input", tracks: PAGE_TEXTS.tracks,
  parts: { n: "N not water", o: "O obstacle", m: "M urgency", u: "U uncertainty", limit: "limit" },
  corridors: { left: "Left", center: "Centre", right: "Right" }, steps: ["Picture", "Age", "Centre", "Sides", "Advice"],
  verdicts: { occupied: "occupied", blocked: "blocked", clear: "clear" }, input: { picture: "Picture", age: "Age", mask: "Mask", inference: "Inference" },
  stale: "stale, ", none: "no advice received", usable: "usable", unusable: "unusable", noPicture: "none", noTracks: "No tracks", unseen: "unseen",
  tracked: (/** @type {number} */ all, /** @type {number | undefined} */ counting) => `${all} tracked${counting === undefined ? "" : `, ${counting} in the risk`}`,
};

/** A track by its kind, and one whose name is not known. */
export const TRACK_TEXTS = { immediate: "immediate", accepted: "accepted", tentative: "tentative", unnamed: "track" };

/** An age that is none, and one in words. */
export const NEVER = "never";
export const agoText = (/** @type {string} */ age) => `${age} ago`;

/** Why the boat stands, beside the list of reasons. */
export const INHIBIT_TEXTS = { unusable: "picture unusable", stopHolds: "STOP holds: hold the button to arm, which releases it" };

/** The link. */
export const LINK_TEXTS = {
  replay: "replay", lost: "LOST", waiting: "waiting", notPlaying: "not playing", live: "live", wasLost: "was lost", noConnection: "no connection", ofFile: "of a file",
  noData: "no data", forData: "for data", age: "age of data",
};

/** The log. */
export const LOG_TEXTS = { title: PAGE_TEXTS.log, label: "Log, newest first", past: "Log until the moment shown, newest first" };

/** The motion panel. */
export const MOTION_TEXTS = {
  title: PAGE_TEXTS.motion, inhibits: "Why it does not move", left: "Port", right: "Starboard",
  applied: "thrust applied", zero: "zero thrust", silent: "no data from the thrust adapter", clear: "Nothing inhibits thrust",
  setSpeed: "Set speed", setHeading: "Set heading", crossTrack: "Cross-track", age: "Command age", battery: "Battery",
};

/** What the operator ordered last, and what became of it. */
export const ORDER_TEXTS = {
  readOnly: "READ-ONLY", played: "a recording is played", unknown: "operator state unknown", stopped: "STOPPED", armed: "ARMED", notArmed: "NOT ARMED", lastKnown: "last known state",
  by: "by", noThrust: "thrust not allowed", notWritten: "could not be written to disk", before: "latched before this start", asked: "STOP ASKED", waiting: "waiting for the thrust adapter",
  notConfirmed: "NOT CONFIRMED", noZero: "STOP is latched, but the thrust adapter does not report zero",
  confirmed: (/** @type {string} */ ms) => `confirmed by the thrust adapter in ${ms} ms`,
  askedAgo: (/** @type {string} */ ms) => `${ms} ms ago`,
  nobody: (/** @type {string} */ seconds) => `nobody answers; asked again for ${seconds} s`,
};

/** The recorder. */
export const RECORD_TEXTS = {
  on: "REC", off: "not recording", silent: "the recorder is silent",
  dropped: (/** @type {number} */ count) => `${count} dropped`,
  title: (/** @type {any} */ state, /** @type {string} */ gib) => `${state.file}: ${state.written} written, ${state.dropped} dropped, ${state.missing} missing; ${gib} GiB left`,
};

/** Driving by hand. */
export const DRIVE_TEXTS = {
  override: PAGE_TEXTS.override, vetoed: "The advice gives no thrust ahead", letGo: "Let go: zero thrust", ahead: "Ahead", astern: "Astern", port: "to port", starboard: "to starboard",
  overridden: (/** @type {string} */ seconds) => `Advice overridden, ${seconds} s left`,
};

/** From the advice to the thrust. */
export const STAGE_TEXTS = {
  label: "From the advice to the thrust", armedBy: "armed by", unnamed: "unnamed", staysIn: "stays in", keepsOut: "keeps out of", off: "off: turns as advised", advised: "advised", because: "for",
  waypoint: (/** @type {number} */ next, /** @type {number} */ all, /** @type {string} */ route) => `, waypoint ${next} of ${all} of ${route}`,
  errors: (/** @type {string} */ speed, /** @type {string} */ heading) => `speed error ${speed} m/s, heading error ${heading}°`,
  thrust: (/** @type {string} */ port, /** @type {string} */ starboard) => `port ${port} N, starboard ${starboard} N`,
  steers: (/** @type {string} */ heading, /** @type {string} */ speed) => `steers ${heading}° at ${speed} m/s`,
};

/** The devices of a hull. */
export const DEVICE_TEXTS = {
  none: "no report yet", yes: "yes", no: "no", sensors: "Sensors", bridge: "Bridge to the indicator", thrusters: "Line to the thrusters",
  columns: ["Device", "State", "Line", "Rate", "Checksum", "Damaged", "Withheld", "Reconnected", "Says"],
};
export const INDICATOR_TEXTS = {
  title: "Indicator", leds: "LEDs", none: "no report from the bridge yet", silent: "the bridge is silent", unknown: "UNKNOWN",
  facts: (/** @type {string} */ mcu, /** @type {string} */ ms, /** @type {number} */ boot) => `${mcu} · ${ms} ms · boot ${boot}`,
  counts: (/** @type {number} */ answered, /** @type {number} */ sent, /** @type {string} */ ms, /** @type {string} */ causes, /** @type {string} */ reset) =>
    `${answered} of ${sent} frames answered, p95 ${ms} ms, refused: ${causes || "none"}; last reset: ${reset}`,
};
export const SENSOR_TEXTS = {
  title: "Sensors", none: "no report from the sensor process yet", silent: "the sensor process is silent",
  counts: (/** @type {any} */ device) =>
    `${device.heard || "nothing heard"}; checksum failures ${device.checksum_failures}, damaged ${device.damaged}, withheld ${device.withheld}, reconnections ${device.reconnections}`,
};

/** Faults of a mission that is drawn, and of a file with one. */
export const FAULT_TEXTS = {
  fewCorners: "needs 3 corners", sameCorners: "two corners are the same", crossing: "its edges cross", smallArea: "hardly any area", fewWaypoints: "a route needs 2 waypoints",
  waypoint: "waypoint", sameWaypoint: "the next is the same", outside: "leaves the fence", land: "crosses land", occupied: "the boat has seen something there",
  area: (/** @type {boolean} */ isIn, /** @type {number} */ number) => `${isIn ? "keep-in" : "keep-out"} area ${number}`,
  leg: (/** @type {number} */ number) => `leg ${number}`,
  tooManyWaypoints: (/** @type {number} */ most) => `more than ${most} waypoints`,
  tooManyCorners: (/** @type {number} */ most) => `more than ${most} corners`,
  tooManyPairs: (/** @type {number} */ waypoints, /** @type {number} */ corners, /** @type {number} */ most) => `${waypoints} waypoints times ${corners} corners is more than ${most}`,
  rally: "rally points", tooManyRally: (/** @type {number} */ most) => `more than ${most} rally points`,
  tooManyRallyPairs: (/** @type {number} */ points, /** @type {number} */ corners, /** @type {number} */ most) => `${points} rally points times ${corners} corners is more than ${most}`,
  tooManyLegs: (/** @type {number} */ most) => `more than ${most} legs`,
  endless: (/** @type {number} */ number) => `leg ${number} has no end, so no leg may come after it`,
  near: (/** @type {number} */ marginM) => `nearer than ${marginM} m to the fence`, nearLand: (/** @type {number} */ marginM) => `nearer than ${marginM} m to land`,
  tight: (/** @type {number} */ radiusM) => `a turn too tight for the hull, ${radiusM} m`,
};
export const FILE_TEXTS = {
  noPlace: "a position is no place on Earth", empty: "no route and no area in it", doctype: "has a DOCTYPE, which no GPX file needs", noGpx: "is no GPX file", noGeoJson: "is no GeoJSON",
  tooLarge: (/** @type {number} */ mb) => `larger than ${mb} MB`,
  tooManyPoints: (/** @type {number} */ count, /** @type {number} */ most) => `${count} points, more than ${most}`,
  noDegrees: (/** @type {string} */ text) => `"${text}" is no number of degrees`,
};

/** The tuning strip. */
export const TUNING_TEXTS = {
  title: PAGE_TEXTS.tuning, configured: "the configuration in force",
  inForce: (/** @type {string} */ name, /** @type {string} */ changes) => `${name} in force: ${changes}`,
  tried: (/** @type {string} */ name, /** @type {string} */ changes) => `${name} tried: ${changes}`,
  last: (/** @type {string} */ active, /** @type {string} */ shadow) => `last: ${active}, tried: ${shadow}`,
  counts: (/** @type {any} */ shadow, /** @type {string} */ percent) =>
    `${shadow.differing} of ${shadow.frames} frames differ (${percent} %), would move on ${shadow.moves_more} where it stops, stop on ${shadow.stops_more} where it moves`,
};

/** Requests and the login. */
export const REQUEST_TEXTS = { askKey: "The operator's key, which `paani up` prints:", notSent: "not sent: no connection to the dashboard", noAnswer: "no answer from the dashboard" };
export const LOGIN_TEXTS = { noConnection: "No connection to the dashboard.", wrongKey: "That is not the operator's key.", latched: "STOPPED: latched until an operator arms." };

/** Reasons for zero thrust: inhibits of navigator and controller, and zero causes of the thrust adapter. @type {Record<string, string>} */
export const STOP_REASONS = {
  NOT_ARMED: "not armed",
  NO_CLOCK: "no time received from the boat", CLOCK_STOPPED: "the boat's clock has stopped",
  NO_ODOMETRY: "position unknown",
  STALE_ODOMETRY: "position too old",
  UNHEALTHY_ODOMETRY: "position estimate not healthy",
  NO_ADVISORY: "no advice yet", STALE_ADVISORY: "advice too old",
  ADVISED_STOP: "the advisor advises STOP",
  ADVISED_NO_DATA: "the advisor has no evidence",
  TURN_CAPPED: "turned as far as allowed without finding a clear direction",
  NO_FREE_PATH: "no trajectory is known to be free",
  NO_ROUTE: "no route", MAP_MOVED: "the map begins elsewhere since localization began anew: start PAANI anew",
  ROUTE_FINISHED: "route finished",
  HOLDING: "holding station", MISSION_DONE: "mission done",
  OUTSIDE_FENCE: "outside the fence or on land, or too close to its edge",
  NO_ORDER: "no mode received from the operator's process", STALE_ORDER: "the operator's order is too old",
  IDLE: "idle: no mode that moves the boat is chosen",
  NEUTRAL: "the stick is in neutral",
  BLOCKED_AHEAD: "the advisor sees the way ahead blocked",
  WRONG_DOMAIN: "message from another domain",
  NO_COMMAND: "no command yet", STALE_COMMAND: "command too old", COMMAND_INVALID: "command not valid",
  no_command: "no thrust command yet", timeout: "thrust commands stopped coming",
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
  wrong_producer: "thrust command from another process", wrong_domain: "thrust command from another domain",
  old_epoch: "thrust command from an earlier run", replayed: "thrust command repeated",
  future: "thrust command from the future", invalid: "thrust command out of range",
};

/** Why a direction is advised. @type {Record<string, string>} */
export const REASONS = {
  CENTER_CLEAR: "centre clear", CENTER_RISK: "centre risk", CENTER_OCCUPIED: "centre occupied", CENTER_VESSEL: "vessel in the centre",
  CENTER_EDGE_INCURSION: "something reaches into the centre", TURN_RETAINED: "turn kept a while", TIE_KEPT_SIDE: "sides alike, side kept",
  TIE_STARBOARD: "sides alike, to starboard", NO_SAFE_SIDE: "no safe side", NO_SIDE_UNOCCUPIED: "both sides occupied",
  NO_SIDE_FOR_LONG: "no side is clear for long", STALE_EVIDENCE: "evidence too old", FUTURE_EVIDENCE: "evidence of the future",
  UNUSABLE_IMAGE: "picture unusable", MALFORMED_EVIDENCE: "evidence malformed", NO_EVIDENCE: "no evidence",
};

/** What the boat does: word and kind. `activity.js` says which holds. @type {Record<string, [string, string]>} */
export const ACTIVITIES = {
  STOPPED: ["STOPPED", "stop"],
  NOT_ARMED: ["NOT ARMED", "none"],
  NO_THRUST: ["NO THRUST", "stop"], KEEPING_STATION: ["KEEPING STATION", "stop"],
  HOLDING: ["HOLDING", "go"],
  DONE: ["MISSION DONE", "none"],
  WAITING: ["WAITING", "turn"],
  LOOKING: ["LOOKING FOR A WAY", "turn"],
  AVOIDING: ["AVOIDING", "turn"],
  ROUTE: ["FOLLOWING ROUTE", "go"],
  STATION: ["GOING TO STATION", "go"],
  HOME: ["RETURNING", "go"],
  UNDER_WAY: ["UNDER WAY", "go"], UNORDERED: ["UNDER WAY", "turn"],
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
  kinds: { follow_route: "Route", hold_station: "Hold", return_home: "Return", stop: "Stop", in: "Keep in", out: "Keep out", rally: "Rally" },
  acts: { undo: "Undo", point: "Delete point", item: "Delete leg", load: "In force", open: "Open file", gpx: "GPX ↓", geojson: "GeoJSON ↓" },
  hint: "Press on the map to draw a route, add a leg, an area or rally points, or drop a file here.",
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
  pose: (/** @type {string} */ east, /** @type {string} */ north) => `${east} m E, ${north} m N`,
  noPose: "position unknown", error: "error", next: "next",
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
  course: "off the course", progress: "little made good", heading_change: "off the plan before", advice: "not to the advised side",
  unknown_water: "unseen water on the way", proximity: "near obstacles", path_obstacle: "obstacle further along",
  margin: "into the margin", give_way: "near a vessel's course", passing_side: "past a vessel on the other side", collision: "may be struck",
};

/** The headings on the map. */
export const HEADING_TEXTS = {
  taken: "taken", free: "free", refused: "refused", costs: "costs", dearer: "dearer by", speeds: { fastest: "at the highest speed", between: "at the next", slowest: "at the lowest" },
  none: "No heading is weighed: there is no plan of the last second.",
  off: "No heading is weighed: the planner is off, and the boat turns as advised.",
};

/** Modes: name, and what the boat does in it. @type {Record<string, [string, string]>} */
export const MODE_TEXTS = {
  ROUTE: ["Route", "follows its mission or route"],
  HOLD: ["Hold", "keeps its station here"],
  RETURN: ["Return", "goes home or to a nearer rally point, keeps station there"],
  MANUAL: ["Manual", "does what your hand says"],
  IDLE: ["Idle", "no thrust"],
};

/** Who holds the wheel. */
export const WHEEL_TEXTS = { unknown: "–", nobody: "nobody", thisPage: "this page", otherPage: "another page", silent: "no word from the operator's process", holds: "holds the wheel" };

/** Beside the button that arms. */
export const ARM_TEXTS = { hold: "Hold to arm", release: "Release to arm", armed: "Armed", stands: "Armed, the boat still stands:", nothing: "Nothing else keeps the boat still.", tooShort: "not armed: held for less than a second", tooLong: "not armed: held for more than five seconds" };

/** Why a mode may not start, in a few words. @type {Record<string, string>} */
export const MODE_BARS = {
  NOT_HOLDER: "another hand holds the wheel", NO_POSITION: "position not known well enough", NO_HOME: "home not known yet", NO_MISSION: "no mission and no route",
  NOT_ARMED: "arm first",
};

/** What the thrust moves. @type {Record<string, string>} */
export const MODES = { sim: "SIM", hil: "HIL", hull: "HULL", replay: "REPLAY" };

/** Who stopped or armed the boat, by the name of the process. @type {Record<string, string>} */
export const OPERATORS = { dashboard: "the page", stop: "paani stop", button: "the button", arm: "paani up", "": "an earlier run" };

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
  noAdvice: "advice unknown",
  noMode: "mode unknown",
  place: (/** @type {string} */ name, /** @type {string} */ at, /** @type {string} */ all) => `${name}, ${at} of ${all}`,
  loading: "loading",
};

/** The health tab. */
export const HEALTH_TEXTS = {
  title: PAGE_TEXTS.health, table: "Processes", hint: "Press a process for the last lines of its log.", logLabel: "Log of a process", again: "Read again",
  columns: ["Process", "State", "Rate", "Delay p50", "Delay p95", "Age", "CPU", "Memory [MiB]", "Files", "°C", "Starts", "Dropped", "Says"],
  recorded: "recorded", notPlayed: "not played", ready: "ready", silent: "no report", gone: "gone", notStarted: "not started", noDrops: "none",
  sum: (/** @type {number} */ ready, /** @type {number} */ all) => `${ready} of ${all}`,
  sumTitle: (/** @type {number} */ ready, /** @type {number} */ all, /** @type {string} */ cores) => `${ready} of ${all} ready, ${cores} cores`,
  log: "Log of", empty: "The log is empty.", cut: "Its last lines; those before are in the file.",
};

/** The topics tab. */
export const TOPICS_TEXTS = { title: PAGE_TEXTS.topics, columns: ["Topic", "From", "Rate / nominal [Hz]", "Age", "Size"], search: "Search", searchLabel: "Search topics", table: "Table of topics", value: "Last value", freeze: "Freeze", thaw: "Frozen: go on", none: "Press a topic for its last value", silent: "nothing received", sum: (/** @type {number} */ shown, /** @type {number} */ all) => `${shown} of ${all}` };

/** The settings tab. */
export const SETTING_TEXTS = {
  title: PAGE_TEXTS.settings, table: "Table of settings", search: "Search", searchLabel: "Search settings", changedOnly: "Changed only", promote: "Put in force", rollback: "Take back",
  columns: ["Setting", "Value", "Unit", "Default", "Range", "From", "Try beside"],
  tuned: "tuned", try: "Try", sent: "tried beside what is in force", none: "Nothing is tried. A value that judges can be tried beside the one in force, whose advice alone is obeyed.", of: "of",
};

/** The recordings tab. */
export const RECORDING_TEXTS = {
  title: PAGE_TEXTS.recordings, list: "List of recordings", again: "Read again", columns: ["File", "Began", "Duration", "Size", "State", "Do"],
  off: "Nothing is recorded here. Who starts with paani up --record DIR finds the recordings in this list.",
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
