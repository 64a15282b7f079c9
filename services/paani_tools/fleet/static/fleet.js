// The fleet's table, map and STOP buttons; asks the shore twice a second, and says so when it does not answer.
const POLL_MS = 500;
const SILENT_MS = 2000;
const EARTH_M_PER_DEG = 111_195;
const MAP_SIZE = { width: 1000, height: 500, margin: 40, leastSpanM: 50 };
const SVG = "http://www.w3.org/2000/svg";
const rows = new Map();
let answeredMs = performance.now();

const table = document.getElementById("vessels");
const map = document.getElementById("map");
const summary = document.getElementById("summary");
map.setAttribute("viewBox", `0 0 ${MAP_SIZE.width} ${MAP_SIZE.height}`);
document.getElementById("stop-all").addEventListener("click", () => stop("/api/stop", [...rows.keys()]));

function rowOf(name) {
  let row = rows.get(name);
  if (row) return row;
  const line = document.createElement("tr");
  const cells = ["name", "contact", "mode", "position", "speed", "advice", "inhibits", "health"].map((kind) => {
    const cell = document.createElement("td");
    cell.className = kind;
    line.append(cell);
    return cell;
  });
  const last = document.createElement("td");
  const button = document.createElement("button");
  button.type = "button";
  button.className = "stop";
  button.textContent = "STOP";
  button.setAttribute("aria-label", `STOP ${name}`);
  button.addEventListener("click", () => stop(`/api/stop/${encodeURIComponent(name)}`, [name]));
  const answer = document.createElement("span");
  answer.setAttribute("role", "status");
  last.append(button, " ", answer);
  line.append(last);
  table.append(line);
  row = { line, cells, answer };
  rows.set(name, row);
  return row;
}

function show(vessel) {
  const { line, cells } = rowOf(vessel.name);
  line.className = vessel.contact;
  const age = vessel.age_s === null ? "" : `, ${vessel.age_s.toFixed(1)} s ago`;
  const faults = [...vessel.silent.map((who) => `${who} silent`), ...vessel.unready.map((who) => `${who} not ready`)];
  const trust = vessel.pose_healthy === false ? " (not to be trusted)" : "";
  const texts = [
    vessel.name,
    vessel.contact + age,
    vessel.mode + (vessel.changed_by ? ` by ${vessel.changed_by}` : ""),
    vessel.x_m === null ? "–" : `${vessel.x_m.toFixed(1)}, ${vessel.y_m.toFixed(1)}${trust}`,
    vessel.speed_mps === null ? "–" : vessel.speed_mps.toFixed(2),
    vessel.direction || "–",
    vessel.inhibits.join(", ") || "–",
    faults.join(", ") || (vessel.processes ? `${vessel.processes} well` : "–"),
  ];
  cells.forEach((cell, index) => { cell.textContent = texts[index]; });
}

function draw(vessels) {
  const placed = vessels.filter((v) => v.latitude_deg || v.longitude_deg);
  map.replaceChildren();
  if (!placed.length) return;
  const middle = (values) => (Math.min(...values) + Math.max(...values)) / 2;
  const latitude = middle(placed.map((v) => v.latitude_deg));
  const longitude = middle(placed.map((v) => v.longitude_deg));
  const east = (v) => (v.longitude_deg - longitude) * EARTH_M_PER_DEG * Math.cos((latitude * Math.PI) / 180);
  const north = (v) => (v.latitude_deg - latitude) * EARTH_M_PER_DEG;
  const span = (f) => Math.max(MAP_SIZE.leastSpanM, 2 * Math.max(...placed.map((v) => Math.abs(f(v)))));
  const { width, height, margin } = MAP_SIZE;
  const scale = Math.min((width - 2 * margin) / span(east), (height - 2 * margin) / span(north));
  for (const vessel of placed) {
    const group = document.createElementNS(SVG, "g");
    group.setAttribute("class", vessel.contact);
    const x = width / 2 + east(vessel) * scale;
    const y = height / 2 - north(vessel) * scale;
    const boat = document.createElementNS(SVG, "path");
    boat.setAttribute("class", "boat");
    boat.setAttribute("d", "M 12 0 L -8 7 L -4 0 L -8 -7 Z");
    boat.setAttribute("transform", `translate(${x} ${y}) rotate(${(-vessel.yaw_rad * 180) / Math.PI})`);
    const label = document.createElementNS(SVG, "text");
    label.setAttribute("x", String(x + 14));
    label.setAttribute("y", String(y - 8));
    label.textContent = vessel.contact === "live" ? vessel.name : `${vessel.name} (${vessel.contact})`;
    group.append(boat, label);
    map.append(group);
  }
}

async function stop(path, names) {
  for (const name of names) rowOf(name).answer.textContent = "asking";
  let latched = {};
  try {
    latched = (await (await fetch(path, { method: "POST" })).json()).latched ?? {};
  } catch {
    latched = {};
  }
  for (const name of names) rowOf(name).answer.textContent = latched[name] ? "latched" : "NOT LATCHED";
}

async function poll() {
  try {
    const response = await fetch("/api/fleet", { signal: AbortSignal.timeout(SILENT_MS) });
    const vessels = await response.json();
    vessels.forEach(show);
    draw(vessels);
    answeredMs = performance.now();
    const live = vessels.filter((v) => v.contact === "live").length;
    summary.className = live === vessels.length ? "" : "lost";
    summary.textContent = `${live} of ${vessels.length} vessels live`;
  } catch {
    const silentS = (performance.now() - answeredMs) / 1000;
    summary.className = "lost";
    summary.textContent = `the shore has not answered for ${silentS.toFixed(0)} s: everything here is old`;
  }
  setTimeout(poll, POLL_MS);
}

poll();
