// @ts-check
// Recent pictures, masks and messages of the camera panel, each by the id of its frame.

import { FrameRing, frameId } from "./frame_matching.js";
import { tintMask } from "./overlay.js";
import { decodePicture } from "./picture_decoding.js";

const MESSAGES = ["perception/evidence", "advisor/tracks", "advisor/advisory"];
/** What changes how the camera's panel looks. */
export const CAMERA_KEYS = new Set([...MESSAGES, "camera/picture", "perception/mask", "dashboard/settings"]);

export class CameraFrames {
  constructor() {
    /** @type {FrameRing<{picture: import("./picture_decoding.js").DecodedPicture, header: any}>} */
    this.pictures = new FrameRing((dropped) => dropped.picture.image.close());
    /** @type {FrameRing<OffscreenCanvas>} */
    this.masks = new FrameRing();
    /** @type {Record<string, FrameRing<any>>} */
    this.messages = Object.fromEntries(MESSAGES.map((key) => [key, new FrameRing()]));
    this.generation = 0; // a picture that is decoded after a `clear` belongs to another moment
  }

  /** A picture, a mask, or a message of a frame; anything else is passed over. @param {string} key @param {any} value @param {Uint8Array} body */
  async put(key, value, body) {
    if (key === "camera/picture") await this.addPicture(value, body);
    else if (key === "perception/mask") await this.addMask(value, body);
    else this.messages[key]?.put(frameId(value), value);
  }

  /** @param {any} header @param {Uint8Array} body */
  async addPicture(header, body) {
    const { generation } = this;
    const picture = await decodePicture(body, header.media_type);
    if (generation !== this.generation) picture.image.close();
    else this.pictures.put(frameId(header), { picture, header });
  }

  /** @param {any} header @param {Uint8Array} body */
  async addMask(header, body) {
    const { generation } = this, classes = await decodePicture(body, header.media_type, "none");
    if (generation === this.generation) this.masks.put(frameId(header), tintMask(classes));
    classes.image.close();
  }

  clear() {
    this.generation++;
    for (const ring of [this.pictures, this.masks, ...Object.values(this.messages)]) ring.clear();
  }
}
