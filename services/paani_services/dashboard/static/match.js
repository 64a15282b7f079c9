// @ts-check
// Which frame to show: picture, evidence and mask belong together only when they carry the same frame id. Pure.

const DEPTH = 16;
const MASK_LAG_FRAMES = 2; // wait this long for a mask before showing boxes without it

/** @param {{frame_epoch: number, frame_seq: number}} message */
export const frameId = (message) => `${message.frame_epoch}.${message.frame_seq}`;

/** Recent values by frame id, newest last. @template T */
export class FrameRing {
  /** @param {(value: T) => void} [onDrop] called with what falls out */
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
      if (this.byId.size <= DEPTH) break;
      this.byId.delete(oldest);
      this.onDrop(dropped);
    }
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
 * The frame to draw: the newest picture that has evidence, one with its mask if that is only a little older;
 * without evidence in reach, the newest picture and nothing on it.
 * @param {string[]} pictures ids, newest first
 * @param {(id: string) => boolean} hasEvidence
 * @param {(id: string) => boolean} hasMask
 * @returns {{id: string | null, evidence: boolean, mask: boolean}}
 */
export function choose(pictures, hasEvidence, hasMask) {
  const judged = pictures.filter(hasEvidence);
  if (!judged.length) return { id: pictures[0] ?? null, evidence: false, mask: false };
  const masked = judged.slice(0, MASK_LAG_FRAMES).find(hasMask);
  return { id: masked ?? judged[0], evidence: true, mask: masked !== undefined };
}
