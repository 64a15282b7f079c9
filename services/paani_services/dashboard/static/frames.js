// @ts-check
// One WebSocket frame: `u8 keylen | u16 headlen | key | header JSON | body`, integers big-endian. Pure.

const utf8 = new TextDecoder();

/**
 * @typedef {{age_ms: number, picture?: any}} FrameHeader
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

/** @param {Uint8Array} body */
export function decodeJson(body) {
  return JSON.parse(utf8.decode(body));
}
