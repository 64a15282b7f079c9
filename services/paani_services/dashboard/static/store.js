// @ts-check
// The newest value of each key and its age: the age on the server plus the time since its receipt here.

const SETTLE_MS = 600, MAX_DELAYS = 200;

/** @typedef {{value: any, at: number, ageMs: number, bytes: number}} Entry */

export class Store {
  constructor() {
    /** @type {Map<string, Entry>} */
    this.entries = new Map();
    /** When a key was heard again after a silence longer than its limit. @type {Map<string, number>} */
    this.heardAgainAt = new Map();
    /** @type {Map<string, number>} */
    this.freshS = new Map();
    this.boatHeardAt = 0;
    /** @type {Map<string, number[]>} */
    this.delays = new Map();
  }

  /** @param {string} key @param {any} value @param {number} ageMs @param {number} now @param {number} [bytes] its size on the way here */
  put(key, value, ageMs, now, bytes = 0) {
    if (this.entries.has(key) && this.ageS(key, now) > this.limitS(key)) this.heardAgainAt.set(key, now);
    this.entries.set(key, { value, at: now, ageMs, bytes });
    if (value.sent_us && value.source_us) {
      const delays = this.delays.get(key) ?? [];
      delays.push(Math.max(0, value.sent_us - value.source_us) / 1000);
      if (delays.length > MAX_DELAYS) delays.shift();
      this.delays.set(key, delays);
    }
    if (key === "dashboard/settings") {
      for (const topic of value.topics) this.freshS.set(topic.name, topic.fresh_s);
    }
    const isFromDashboard = key.startsWith("dashboard/") || key.startsWith("operator/") || key === "health/operator" || key === "health/dashboard";
    if (!isFromDashboard) this.boatHeardAt = Math.max(this.boatHeardAt, now - ageMs);
  }

  /** @param {string} key */
  get(key) {
    return this.entries.get(key)?.value;
  }

  /** From what the newest messages of a key are made of until they were sent [ms], oldest first. @param {string} key */
  delaysMs(key) {
    return this.delays.get(key) ?? [];
  }

  /** Seconds; infinite before the first. @param {string} key @param {number} now */
  ageS(key, now) {
    const entry = this.entries.get(key);
    return entry ? (Math.max(0, now - entry.at) + entry.ageMs) / 1000 : Infinity; // a table is drawn by a moment that its messages may have overtaken
  }

  /** The age beyond which a key is stale [s]. @param {string} key */
  limitS(key) {
    return this.freshS.get(key) ?? (key.startsWith("health/") ? 3 : 1);
  }

  /** A key that was stale is fresh again once it has been heard for `SETTLE_MS`, so that it does not flap under load. @param {string} key @param {number} now */
  isFresh(key, now) {
    return this.ageS(key, now) <= this.limitS(key) && now - (this.heardAgainAt.get(key) ?? -Infinity) >= SETTLE_MS;
  }

  /** Seconds since the last message from the boat. @param {number} now */
  silenceS(now) {
    return this.boatHeardAt ? (now - this.boatHeardAt) / 1000 : Infinity;
  }
}
