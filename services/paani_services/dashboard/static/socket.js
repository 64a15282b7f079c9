// @ts-check
// One WebSocket that reconnects by itself; one whose place was given to another page, at the next click.

import { decodeFrame } from "./frames.js";

const BACKOFF_MS = [250, 500, 1000, 2000];
const GIVEN_AWAY = 4001; // as in server.py
const SILENCE_TIMEOUT_MS = 3000; // the server sends at least five frames a second

/**
 * @param {(key: string, header: import("./frames.js").FrameHeader, body: Uint8Array) => void} onFrame
 * @param {(open: boolean) => void} onOpen
 */
export function connect(onFrame, onOpen) {
  let attempt = 0;
  const open = () => {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}:${"//"}${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    let receivedAt = performance.now();
    const watchdog = setInterval(() => {
      if (performance.now() - receivedAt > SILENCE_TIMEOUT_MS) socket.close();
    }, 500);
    socket.onopen = () => {
      attempt = 0;
      onOpen(true);
    };
    socket.onmessage = (event) => {
      receivedAt = performance.now();
      const { key, header, body } = decodeFrame(event.data);
      onFrame(key, header, body);
    };
    socket.onclose = (event) => {
      clearInterval(watchdog);
      onOpen(false);
      if (event.code === GIVEN_AWAY) {
        window.addEventListener("pointerdown", open, { once: true });
        return;
      }
      setTimeout(open, BACKOFF_MS[Math.min(attempt++, BACKOFF_MS.length - 1)]);
    };
  };
  open();
}
