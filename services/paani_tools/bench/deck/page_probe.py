"""What a page does with each frame of the camera, noted by a script that runs before the page's own."""

from __future__ import annotations

from typing import Any

from paani_tools.bench.deck.picture_path import PageMoments

# Listens to the socket before the page's own handler does, to what decodes pictures, and to the camera's canvas.
PROBE = """(() => {
  const nowUs = () => 1e3 * (performance.timeOrigin + performance.now()), utf8 = new TextDecoder();
  const PARTS = { 'camera/picture': 'picture', 'perception/mask': 'mask', 'perception/evidence': 'evidence' };
  const frames = new Map(), done = [];
  let current = null, last = null;
  const note = (seq, what) => {
    if (!frames.has(seq)) frames.set(seq, {});
    frames.get(seq)[what] ??= nowUs();
    for (const [oldest] of frames) if (frames.size > 64) frames.delete(oldest);
  };
  const NativeSocket = WebSocket;
  window.WebSocket = class extends NativeSocket {
    constructor(...given) {
      super(...given);
      this.addEventListener('message', ({ data }) => {
        const view = new DataView(data), headAt = 3 + view.getUint8(0), bodyAt = headAt + view.getUint16(1);
        const part = PARTS[utf8.decode(new Uint8Array(data, 3, headAt - 3))];
        current = null;
        if (!part) return;
        const head = new Uint8Array(data, headAt, bodyAt - headAt), body = new Uint8Array(data, bodyAt);
        const message = JSON.parse(utf8.decode(part === 'evidence' ? body : head));
        const seq = (message.picture ?? message).frame_seq;
        note(seq, part);
        current = { seq, part };
      });
    }
  };
  const decode = window.createImageBitmap;
  window.createImageBitmap = (...given) => {
    const now = current, decoding = decode(...given);
    if (now) decoding.then(() => note(now.seq, 'decoded_' + now.part));
    return decoding;
  };
  const Decoder = window.ImageDecoder;
  if (Decoder) window.ImageDecoder = class extends Decoder {
    decode(...given) {
      const now = this.of, decoding = super.decode(...given);
      if (now) decoding.then(() => note(now.seq, 'decoded_' + now.part));
      return decoding;
    }
    of = current;
  };
  const drawImage = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function (...given) {
    drawImage.apply(this, given);
    if (this.canvas.id === 'camera') queueMicrotask(look);
  };
  const look = () => {
    const seq = paani.overlay.picture_seq;
    if (seq === null || seq === last) return;
    last = seq;
    const frame = { seq, ...frames.get(seq), drawn: nowUs() };
    requestAnimationFrame(() => done.push({ ...frame, shown: nowUs() }));
  };
  window.probe = { take: () => done.splice(0) };
})()"""
TAKE = "probe.take()"


def page_moments(noted: dict[str, Any]) -> PageMoments | None:
    """None where the page drew a picture before its evidence and mask, as it does where they are late."""
    try:
        decoded_us = max(noted["decoded_picture"], noted["decoded_mask"])
        return PageMoments(
            int(noted["seq"]), noted["evidence"], noted["mask"], decoded_us, noted["drawn"], noted["shown"]
        )
    except KeyError:
        return None
