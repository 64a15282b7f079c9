// @ts-check
// Chooses the frame to show: picture, evidence and mask belong together only with the same frame id. Pure.

const MAX_FRAMES = 16;
const MAX_MASK_LAG_FRAMES = 2; // wait this many frames for a mask before showing boxes without one

/** @param {{frame_epoch: number, frame_seq: number}} message */
export const frameId = (message) => `${message.frame_epoch}.${message.frame_seq}`;

/** Recent values by frame id, newest last. @template T */
export class FrameRing {
  /** @param {(value: T) => void} [onDrop] called with each value that is replaced or removed */
  constructor(onDrop = () => {}) {
    /** @type {Map<string, T>} */
    this.byId = new Map();
    this.onDrop = onDrop;
  }

  /** @param {string} id @param {T} value */
  put(id, value) {
    const before = this.byId.get(id);
    if (before !== undefined) {
      this.byId.delete(id);
      if (before !== value) this.onDrop(before);
    }
    this.byId.set(id, value);
    for (const [oldest, dropped] of this.byId) {
      if (this.byId.size <= MAX_FRAMES) break;
      this.byId.delete(oldest);
      this.onDrop(dropped);
    }
  }

  clear() {
    for (const dropped of this.byId.values()) this.onDrop(dropped);
    this.byId.clear();
  }

  /** @param {string} id */
  get(id) {
    return this.byId.get(id);
  }

  /** Newest first. */
  ids() {
    return [...this.byId.keys()].reverse();
  }
}

/**
 * Chooses the newest picture that has evidence, or one that is slightly older and has a mask too.
 * Without any evidence it is the newest picture, without an overlay.
 * @param {string[]} pictures ids, newest first
 * @param {(id: string) => boolean} hasEvidence
 * @param {(id: string) => boolean} hasMask
 * @returns {{id: string | null, evidence: boolean, mask: boolean}}
 */
export function chooseFrame(pictures, hasEvidence, hasMask) {
  const withEvidence = pictures.filter(hasEvidence);
  if (!withEvidence.length) return { id: pictures[0] ?? null, evidence: false, mask: false };
  const withMask = withEvidence.slice(0, MAX_MASK_LAG_FRAMES).find(hasMask);
  return { id: withMask ?? withEvidence[0], evidence: true, mask: withMask !== undefined };
}
