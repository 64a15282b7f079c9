// @ts-check
// The newest value of each key and its age: the age on the server plus the time since its receipt here.

const SETTLE_MS = 600;

/** @typedef {{value: any, at: number, ageMs: number}} Entry */

export class Store {
  constructor() {
    /** @type {Map<string, Entry>} */
    this.entries = new Map();
    /** When a key was heard again after a silence longer than its limit. @type {Map<string, number>} */
    this.heardAgainAt = new Map();
    /** @type {Map<string, number>} */
    this.freshS = new Map();
    this.boatHeardAt = 0;
  }

  /** @param {string} key @param {any} value @param {number} ageMs @param {number} now */
  put(key, value, ageMs, now) {
    if (this.entries.has(key) && this.ageS(key, now) > this.limitS(key)) this.heardAgainAt.set(key, now);
    this.entries.set(key, { value, at: now, ageMs });
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

  /** Seconds; infinite before the first. @param {string} key @param {number} now */
  ageS(key, now) {
    const entry = this.entries.get(key);
    return entry ? (now - entry.at + entry.ageMs) / 1000 : Infinity;
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
