// @ts-check
// One WebSocket that comes back by itself.

import { decodeFrame } from "./frames.js";

const BACKOFF_MS = [250, 500, 1000, 2000];
const SILENT_MS = 3000; // the server speaks five times a second

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
    let heardAt = performance.now();
    const watch = setInterval(() => {
      if (performance.now() - heardAt > SILENT_MS) socket.close();
    }, 500);
    socket.onopen = () => {
      attempt = 0;
      onOpen(true);
    };
    socket.onmessage = (event) => {
      heardAt = performance.now();
      const { key, header, body } = decodeFrame(event.data);
      onFrame(key, header, body);
    };
    socket.onclose = () => {
      clearInterval(watch);
      onOpen(false);
      setTimeout(open, BACKOFF_MS[Math.min(attempt++, BACKOFF_MS.length - 1)]);
    };
  };
  open();
}
