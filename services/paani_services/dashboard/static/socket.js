// @ts-check
// One WebSocket that reconnects by itself; one whose place was given to another page, at the next click.

import { Delay } from "./delay.js";
import { decodeFrame } from "./frames.js";

const BACKOFF_MS = [250, 500, 1000, 2000];
const GIVEN_AWAY = 4001; // as in server.py
const SILENCE_TIMEOUT_MS = 3000; // the server sends at least five frames a second
const MAX_DELAY_MS = 5000; // a connection that is further behind is given up, with all that waits in it

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
    const delay = new Delay();
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
      const { key, header, body } = decodeFrame(event.data), delayMs = delay.of(Number(header.made_us) / 1000, receivedAt);
      onFrame(key, { ...header, age_ms: header.age_ms + delayMs }, body);
      if (delayMs > MAX_DELAY_MS) socket.close();
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
