// @ts-check
// Draws what lies under everything else on the map: the grid of metres, and over it the scale.

const ROUND_LENGTHS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500];
const GRID_PX = 56, SCALE_PX = 60, SCALE_ROOM_PX = 6;

/** The least round length that is so wide on the screen. @param {number} pxPerM @param {number} leastPx */
const roundLength = (pxPerM, leastPx) => ROUND_LENGTHS_M.find((m) => m * pxPerM >= leastPx) ?? 500;

/** @param {CanvasRenderingContext2D} ctx @param {import("./map_projection.js").MapProjection} projection @param {string} colour */
export function drawGrid(ctx, projection, colour) {
  const step = roundLength(projection.pxPerM, GRID_PX), { west, east, south, north } = projection.extent;
  const crisp = projection.sin ? (/** @type {number} */ px) => px : (/** @type {number} */ px) => Math.round(px) + 0.5;
  const line = (/** @type {[number, number]} */ from, /** @type {[number, number]} */ to) => {
    ctx.moveTo(crisp(from[0]), crisp(from[1]));
    ctx.lineTo(crisp(to[0]), crisp(to[1]));
  };
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1;
  ctx.globalAlpha = 0.55;
  ctx.beginPath();
  for (let x = Math.ceil(west / step) * step; x <= east; x += step) line(projection.toScreen(x, south), projection.toScreen(x, north));
  for (let y = Math.ceil(south / step) * step; y <= north; y += step) line(projection.toScreen(west, y), projection.toScreen(east, y));
  ctx.stroke();
  ctx.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./map_projection.js").MapProjection} projection @param {string} colour @param {string} ground below it, so that it is legible on every chart */
export function drawScale(ctx, { pxPerM, height }, colour, ground) {
  const metres = roundLength(pxPerM, SCALE_PX), px = metres * pxPerM;
  ctx.fillStyle = ground;
  ctx.fillRect(12 - SCALE_ROOM_PX, height - 44, px + 2 * SCALE_ROOM_PX, 38);
  ctx.strokeStyle = ctx.fillStyle = colour;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(12, height - 18); ctx.lineTo(12, height - 12); ctx.lineTo(12 + px, height - 12); ctx.lineTo(12 + px, height - 18);
  ctx.stroke();
  ctx.font = "12px system-ui, sans-serif";
  ctx.fillText(`${metres} m`, 12, height - 24);
}
