// @ts-check
// Samples of a drive, one a second, and its events: of the last ten minutes, or of a recording.

/** @typedef {{at_us: number, level: string, text: string}} PastEvent */

export class Series {
  /** @param {number} [maxSamples] the oldest go first */
  constructor(maxSamples = Infinity) {
    this.maxSamples = maxSamples;
    /** @type {Record<string, any[]>} */
    this.columns = { at_us: [] };
    /** @type {PastEvent[]} */
    this.events = [];
    this.version = 0;
  }

  /** @param {{samples: {names: string[], values: any[][]}, events: PastEvent[]}} answer */
  load({ samples, events }) {
    this.columns = Object.fromEntries(samples.names.map((name, index) => [name, [...samples.values[index]]]));
    this.events = [...events];
    this.version++;
  }

  /** @param {Record<string, any>} sample */
  append(sample) {
    if (sample.at_us <= this.endUs) return;
    const { length } = this;
    for (const name of Object.keys(sample)) {
      const column = (this.columns[name] ??= new Array(length).fill(null));
      column.push(sample[name]);
    }
    while (this.length > this.maxSamples) for (const column of Object.values(this.columns)) column.shift();
    this.version++;
  }

  /** @param {PastEvent} event */
  addEvent(event) {
    if (this.events.some((each) => each.at_us === event.at_us && each.text === event.text)) return;
    this.events.push(event);
    while (this.events.length && this.events[0].at_us < this.startUs) this.events.shift();
    this.version++;
  }

  get length() {
    return this.columns.at_us.length;
  }

  get startUs() {
    return this.columns.at_us[0] ?? 0;
  }

  get endUs() {
    return this.columns.at_us.at(-1) ?? 0;
  }

  /** The last sample at or before a moment; the first where there is none; -1 in an empty series. @param {number} atUs */
  indexAt(atUs) {
    const at = this.columns.at_us;
    let low = 0, high = at.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (at[middle] <= atUs) low = middle + 1;
      else high = middle;
    }
    return at.length ? Math.max(0, low - 1) : -1;
  }

  /** Where the boat was until a moment. @param {number} atUs */
  trackUntil(atUs) {
    const { x_m = [], y_m = [] } = this.columns, end = this.indexAt(atUs) + 1;
    return x_m.slice(0, end).flatMap((x, index) => (x === null ? [] : [{ x, y: y_m[index] }]));
  }
}
