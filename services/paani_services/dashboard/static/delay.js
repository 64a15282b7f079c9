// @ts-check
// How long a frame waited on its way here, at the server, in a socket or on a slow link: what it says is older by that.

const MAX_DRIFT = 5e-4; // of the server's clock against this one

/** Of one connection. The two clocks have nothing in common, so that its quickest frame counts as not having waited. */
export class Delay {
  constructor() {
    this.quickestMs = Infinity;
    this.at = 0;
  }

  /** Milliseconds. @param {number} madeMs by the server's clock @param {number} now by this one */
  of(madeMs, now) {
    const tookMs = now - madeMs;
    this.quickestMs = Math.min(tookMs, this.quickestMs + MAX_DRIFT * (now - this.at));
    this.at = now;
    return tookMs - this.quickestMs;
  }
}
