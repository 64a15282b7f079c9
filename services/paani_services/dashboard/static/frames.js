// @ts-check
// One frame of a WebSocket, or of an answer about the past: `u8 keylen | u16 headlen | key | header JSON | body`, integers big-endian. Pure.

const utf8 = new TextDecoder();

/**
 * @typedef {{age_ms: number, picture?: any, at_us?: number, made_us?: number}} FrameHeader
 * @param {ArrayBuffer} buffer
 * @returns {{key: string, header: FrameHeader, body: Uint8Array}}
 */
export function decodeFrame(buffer) {
  const view = new DataView(buffer);
  const headAt = 3 + view.getUint8(0);
  const bodyAt = headAt + view.getUint16(1);
  if (bodyAt > buffer.byteLength) throw new RangeError("frame shorter than its key and header");
  return {
    key: utf8.decode(new Uint8Array(buffer, 3, headAt - 3)),
    header: JSON.parse(utf8.decode(new Uint8Array(buffer, headAt, bodyAt - headAt))),
    body: new Uint8Array(buffer, bodyAt),
  };
}

/** Frames one after the other, each after its length in four bytes. @param {ArrayBuffer} packed */
export function unpackFrames(packed) {
  const view = new DataView(packed), found = [];
  for (let at = 0; at < packed.byteLength;) {
    const end = at + 4 + view.getUint32(at);
    found.push(decodeFrame(packed.slice(at + 4, end)));
    at = end;
  }
  return found;
}

/** @param {Uint8Array} body */
export function decodeJson(body) {
  return JSON.parse(utf8.decode(body));
}
