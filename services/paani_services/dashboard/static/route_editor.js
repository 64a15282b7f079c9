// @ts-check
// The editor on the map: legs, fence and rally points are drawn, checked as they are, and sent to the operator's process as one request,
// which accepts or refuses the whole. Nothing that is drawn is in force before that.

import { findMarks } from "./mission_checks.js";
import { leg, mapOrigin, rallyOf, readFile, writeGeoJson, writeGpx } from "./mission_files.js";
import { MissionPlan } from "./mission_plan.js";
import { drawPlan } from "./plan_drawing.js";
import { hand, hasKey, post } from "./requests.js";
import { EDITOR, byId, make, setText } from "./text.js";

const SEND_MS = 30000; // the server checks a large mission for up to 20 s
const REACH_PX = 14, DRAG_PX = 4, MAX_SHOWN = 3;
const MAX_SHARE = 0.1; // of the page's time for checks: a large mission is checked less often, so that the page answers

export class RouteEditor {
  /** @param {import("./map.js").MapPanel} map */
  constructor(map) {
    this.map = map;
    this.made = new MissionPlan();
    this.isOpen = false;
    /** Where the pointer went down, on the page and on the map, and whether it drags a point. @type {{x: number, y: number, at: import("./plane_geometry.js").Point, drags: boolean} | null} */
    this.press = null;
    /** @type {import("./mission_checks.js").Mark[]} */
    this.marks = [];
    this.checked = "";
    this.checkAgainAt = 0;
    /** What the navigator says of land, and that as text. @type {[any, string]} */
    this.land = [undefined, ""];
    this.note = "";
    /** @type {import("./store.js").Store | null} */
    this.store = null;
    this.bindButtons();
    this.bindMap();
  }

  bindButtons() {
    byId("map-edit").addEventListener("click", () => this.setOpen(!this.isOpen));
    for (const kind of Object.keys(EDITOR.kinds)) this.addButton("editor-add", `+ ${EDITOR.kinds[kind]}`, () => this.made.addItem(kind));
    const acts = { undo: () => this.made.undo(), point: () => this.made.removePoint(), item: () => this.made.removeItem(), load: () => this.load() };
    for (const [name, act] of Object.entries(acts)) this.addButton("editor-acts", EDITOR.acts[name], act);
    this.addButton("editor-acts", EDITOR.acts.open, () => byId("editor-file").click());
    this.addButton("editor-acts", EDITOR.acts.gpx, () => this.save("gpx"));
    this.addButton("editor-acts", EDITOR.acts.geojson, () => this.save("geojson"));
    byId("editor-send").addEventListener("click", () => void this.send());
    byId("editor-file").addEventListener("change", (/** @type {any} */ event) => void this.open(event.target.files[0]));
    for (const field of ["repeat", "laps", "radius_m", "duration_s", "speed_mps"]) {
      byId(`editor-${field}`).addEventListener("change", (/** @type {any} */ { target }) => {
        if (field === "repeat") this.made.change({ repeat: target.checked, laps: target.checked ? 0 : 1 });
        else if (target.value !== "" && target.checkValidity()) this.made.change({ [field]: Number(target.value) });
      });
    }
    addEventListener("keydown", (event) => {
      if (!this.isOpen || event.target instanceof HTMLInputElement) return;
      if (event.key === "Delete" || event.key === "Backspace") this.made.removePoint();
      if (event.key === "z" && (event.ctrlKey || event.metaKey)) this.made.undo();
    });
  }

  /** @param {string} place @param {string} text @param {() => void} act */
  addButton(place, text, act) {
    const button = make("button", "", text);
    Object.assign(button, { type: "button" });
    button.addEventListener("click", () => {
      this.note = "";
      act();
      button.blur();
    });
    byId(place).append(button);
  }

  bindMap() {
    const { canvas } = this.map;
    canvas.addEventListener("pointerdown", (event) => this.isOpen && this.down(event));
    canvas.addEventListener("pointermove", (event) => this.press?.drags && this.made.move(this.map.placeUnder(event)));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.up(/** @type {PointerEvent} */ (event)));
    canvas.addEventListener("dragover", (event) => event.preventDefault());
    canvas.addEventListener("drop", (event) => {
      event.preventDefault();
      this.setOpen(true);
      void this.open(event.dataTransfer?.files[0]);
    });
  }

  /** Whether a point is being dragged, so that the map stays where it is. */
  get isDragging() {
    return Boolean(this.press?.drags);
  }

  /** @param {boolean} isOpen */
  setOpen(isOpen) {
    this.isOpen = isOpen;
    byId("editor").hidden = !isOpen;
    document.body.dataset.editing = String(isOpen);
    byId("map-edit").setAttribute("aria-pressed", String(isOpen));
    if (isOpen) this.map.controls.setFollow(false);
  }

  /** @param {PointerEvent} event */
  down(event) {
    const at = this.map.placeUnder(event), reachM = REACH_PX / this.map.pxPerM;
    this.map.canvas.setPointerCapture(event.pointerId);
    const isGrabbed = this.made.grab(at, reachM);
    if (isGrabbed) this.made.remember();
    this.press = { x: event.clientX, y: event.clientY, at, drags: isGrabbed || this.made.insert(at, reachM) };
    this.note = "";
  }

  /** A press that stayed where it was adds a point; one that moved has moved the map or a point. @param {PointerEvent} event */
  up(event) {
    const press = this.press;
    this.press = null;
    if (!press || press.drags || event.type === "pointercancel") return;
    if (Math.hypot(event.clientX - press.x, event.clientY - press.y) > DRAG_PX) return;
    if (!this.made.items.length) this.made.addItem("follow_route");
    this.made.addPoint(press.at);
  }

  /** The mission in force, or the route. */
  load() {
    const mission = this.store?.get("navigator/mission"), route = this.store?.get("navigator/route");
    if (mission) this.made.replace(structuredClone({ legs: mission.legs, fence: mission.fence ?? [], rally: rallyOf(mission.rally ?? []) }));
    else if (route) this.made.replace({ legs: [leg(structuredClone(route.waypoints), { repeat: route.repeat, laps: route.repeat ? 0 : 1 })], fence: [], rally: [] });
    else this.note = EDITOR.nothing;
  }

  /** Where the map lies on Earth; a file's positions mean nothing before that is known. */
  origin() {
    const pose = this.store?.get("localization/odometry");
    if (!pose) throw new Error(EDITOR.noOrigin);
    return mapOrigin(pose);
  }

  /** @param {File | undefined} file */
  async open(file) {
    if (!file) return;
    try {
      const found = readFile(file.name, await file.text(), this.origin()), { plan } = this.made;
      this.made.replace({
        legs: found.legs.length ? found.legs : plan.legs, fence: found.fence.length ? found.fence : plan.fence, rally: found.rally.length ? found.rally : plan.rally,
      });
      this.note = "";
      this.map.fitTo(this.made.items.flatMap((_, index) => this.made.points(index) ?? []));
    } catch (error) {
      this.note = `${file.name}: ${/** @type {Error} */ (error).message}`;
    }
    byId("editor-file").value = "";
  }

  /** @param {string} kind */
  save(kind) {
    try {
      const text = kind === "gpx" ? writeGpx(this.made.plan, this.origin()) : writeGeoJson(this.made.plan, this.origin());
      const link = /** @type {HTMLAnchorElement} */ (make("a"));
      link.href = URL.createObjectURL(new Blob([text], { type: kind === "gpx" ? "application/gpx+xml" : "application/geo+json" }));
      link.download = `mission.${kind}`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    } catch (error) {
      this.note = /** @type {Error} */ (error).message;
    }
  }

  async send() {
    if (!hasKey()) return;
    byId("editor-send").disabled = true;
    this.note = EDITOR.sent;
    const { legs, fence, rally } = this.made.plan;
    const refused = await post("/api/mission", { hand, name: "drawn", legs, fence, rally: rally.flatMap(({ waypoints }) => waypoints) }, false, SEND_MS);
    this.note = refused || EDITOR.accepted;
    byId("editor-send").disabled = false;
  }

  /** @param {import("./map_objects.js").Chart} chart */
  draw(chart) {
    if (this.isOpen) drawPlan(chart, this.made, this.marks);
  }

  /** What stands above the map. @param {import("./store.js").Store} store @param {number} now */
  renderForm(store, now) {
    this.store = store;
    if (!this.isOpen) return;
    const { made } = this, settings = store.get("dashboard/settings"), grid = store.isFresh("navigator/occupancy", now) ? store.get("navigator/occupancy") : undefined;
    const mission = store.get("navigator/mission"), land = mission?.land ?? [];
    if (mission !== this.land[0]) this.land = [mission, JSON.stringify(land)];
    const state = JSON.stringify(made.plan) + this.land[1] + (grid?.source_us ?? "");
    const began = performance.now();
    if (state !== this.checked && settings && began >= this.checkAgainAt) {
      this.checked = state;
      this.marks = findMarks(made.plan, { marginM: settings.fence_margin_m, turnRadiusM: settings.turn_radius_m, land }, grid);
      this.checkAgainAt = began + (performance.now() - began) / MAX_SHARE;
    }
    this.renderItems();
    const faults = this.marks.slice(0, MAX_SHOWN).map((mark) => mark.text).join(" · ") + (this.marks.length > MAX_SHOWN ? ` · ${this.marks.length - MAX_SHOWN} more` : "");
    const hint = !made.items.length ? EDITOR.hint : faults || EDITOR.fine;
    setText(byId("editor-note"), this.note || hint);
    byId("editor-note").dataset.bad = String(this.note ? this.note !== EDITOR.accepted && this.note !== EDITOR.sent : this.marks.length > 0);
  }

  renderItems() {
    const { made } = this, list = byId("editor-items"), names = made.items.map((item, index) => `${index + 1} ${EDITOR.kinds["corners" in item ? item.keep : item.kind]}`);
    if (list.dataset.names !== names.join()) {
      list.dataset.names = names.join();
      list.replaceChildren(...names.map((name, index) => {
        const button = make("button", "", name);
        button.addEventListener("click", () => { made.current = index; made.point = -1; });
        return button;
      }));
    }
    [...list.children].forEach((button, index) => button.setAttribute("aria-pressed", String(index === made.current)));
    const item = made.items[made.current], kind = item && !("corners" in item) ? item.kind : "";
    byId("editor-route").hidden = kind !== "follow_route";
    byId("editor-station").hidden = kind !== "hold_station";
    byId("editor-pace").hidden = !["follow_route", "return_home"].includes(kind);
    if (!item || "corners" in item) return;
    byId("editor-repeat").checked = item.repeat;
    byId("editor-laps").disabled = !item.repeat;
    for (const field of /** @type {const} */ (["laps", "radius_m", "duration_s", "speed_mps"])) {
      const input = byId(`editor-${field}`);
      if (document.activeElement !== input) input.value = String(item[field]);
    }
  }
}
