// @ts-check
// Words on the map, each at what it names: drawn together, so that none lies on another.

const FONT = "12px system-ui, sans-serif", LINE_PX = 15;

/** Its first line begins at a place of the screen. @typedef {{lines: string[], x: number, y: number, colour: string}} Label */
/** @typedef {Label & {width: number}} Measured */

export class MapLabels {
  constructor() {
    /** @type {Label[]} */
    this.labels = [];
  }

  /** @param {string[]} lines @param {number} x @param {number} y @param {string} colour name of it */
  add(lines, x, y, colour) {
    this.labels.push({ lines, x, y, colour });
  }

  /** @param {CanvasRenderingContext2D} ctx @param {(name: string) => string} colour */
  draw(ctx, colour) {
    ctx.font = FONT;
    const measured = this.labels.map((label) => ({ ...label, width: Math.max(...label.lines.map((line) => ctx.measureText(line).width)) }));
    for (const { lines, x, y, colour: name } of withoutOverlap(measured)) {
      ctx.fillStyle = colour(name);
      lines.forEach((line, index) => drawWords({ ctx, colour }, line, x, y + index * LINE_PX));
    }
  }
}

/** The labels from top to bottom, each as low as it has to be to lie on none before it. @param {Measured[]} labels */
function withoutOverlap(labels) {
  /** @type {Measured[]} */
  const placed = [];
  const height = (/** @type {Measured} */ { lines }) => lines.length * LINE_PX;
  for (const label of [...labels].sort((a, b) => a.y - b.y)) {
    const findCovered = () => placed.find((other) => label.x < other.x + other.width && other.x < label.x + label.width && label.y < other.y + height(other) && other.y < label.y + height(label));
    for (let other = findCovered(); other; other = findCovered()) label.y = other.y + height(other);
    placed.push(label);
  }
  return placed;
}

/** Words in the colour of what they name, with an edge of the map's ground. @param {{ctx: CanvasRenderingContext2D, colour: (name: string) => string}} chart @param {string} text @param {number} x @param {number} y */
function drawWords({ ctx, colour }, text, x, y) {
  ctx.save();
  ctx.strokeStyle = colour("--panel");
  ctx.lineWidth = 4;
  ctx.lineJoin = "round";
  ctx.strokeText(text, x, y);
  ctx.restore();
  ctx.fillText(text, x, y);
}
