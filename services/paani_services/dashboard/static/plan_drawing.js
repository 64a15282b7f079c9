// @ts-check
// Draws the mission that is being made: its lines and points, the one at hand larger, and a sign at each fault.

const NUMBER_PX = 24; // between points that have their numbers beside them

/**
 * @param {import("./map_objects.js").Chart} chart @param {import("./mission_plan.js").MissionPlan} made
 * @param {import("./mission_checks.js").Mark[]} marks
 */
export function drawPlan(chart, made, marks) {
  made.items.forEach((_, index) => drawItem(chart, made, index));
  drawMarks(chart, marks);
}

/** @param {import("./map_objects.js").Chart} chart @param {import("./mission_plan.js").MissionPlan} made @param {number} index */
function drawItem({ ctx, toScreen, pxPerM, colour }, made, index) {
  const item = made.items[index], points = made.points(index) ?? [], isCurrent = index === made.current;
  ctx.strokeStyle = ctx.fillStyle = colour(!("corners" in item) ? "--route" : item.keep === "out" ? "--red" : "--green");
  ctx.globalAlpha = isCurrent ? 1 : 0.6;
  ctx.lineWidth = isCurrent ? 3 : 2;
  ctx.beginPath();
  if (!("kind" in item && item.kind === "rally")) for (const point of points) ctx.lineTo(...toScreen(point.x_m, point.y_m));
  if (made.isClosed(index) && points.length > 2) ctx.closePath();
  ctx.stroke();
  /** @type {[number, number]} */
  let numbered = [-Infinity, 0];
  points.forEach((point, number) => {
    const [x, y] = toScreen(point.x_m, point.y_m), isAtHand = isCurrent && number === made.point;
    ctx.beginPath();
    ctx.arc(x, y, isAtHand ? 8 : isCurrent ? 6 : 4, 0, 7);
    ctx.fill();
    if ("radius_m" in item && item.kind === "hold_station") {
      ctx.beginPath();
      ctx.arc(x, y, Math.max(9, item.radius_m * pxPerM), 0, 7);
      ctx.stroke();
    }
    if (isAtHand) {
      ctx.strokeStyle = colour("--text");
      ctx.stroke();
    }
    if (!isCurrent || (!isAtHand && Math.hypot(x - numbered[0], y - numbered[1]) < NUMBER_PX)) return;
    numbered = [x, y];
    ctx.fillText(String(number + 1), x + 9, y - 7);
  });
  ctx.globalAlpha = 1;
}

/** @param {import("./map_objects.js").Chart} chart @param {import("./mission_checks.js").Mark[]} marks */
function drawMarks({ ctx, toScreen, colour }, marks) {
  for (const { at } of marks) {
    if (!at) continue;
    const [x, y] = toScreen(at.x_m, at.y_m);
    ctx.fillStyle = colour("--alarm");
    ctx.strokeStyle = colour("--on-alarm");
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(x, y - 12); ctx.lineTo(x + 11, y + 8); ctx.lineTo(x - 11, y + 8);
    ctx.closePath();
    ctx.fill();
    ctx.beginPath();
    ctx.moveTo(x, y - 5); ctx.lineTo(x, y + 1); ctx.moveTo(x, y + 4); ctx.lineTo(x, y + 5);
    ctx.stroke();
  }
}
