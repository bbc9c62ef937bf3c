// The local grids: a vehicle whose world has no place on the earth, and its targets, in metres about that world's zero.
// Each has its own. A zero is where the vehicle's own filter began, and north is as that filter believes it: no message
// says how the zeros of two vehicles lie to one another, and one grid for both would claim that it is known.
import { outline } from "./ellipse.js";
import { duration, name } from "./format.js";
import { label, niceStep } from "./graticule.js";
import { arrowShape, SVG, targetMark, vehicleMark } from "./marks.js";

const LEAST_REACH_M = 2;
const ROOM = 1.15;
const SPACING_PX = 60;
const FINGER_PX = 22;
const FOOT_PX = 6;
const FOOT_M = 0.3048;

export class LocalGrids {
  constructor(element, { onTarget }) {
    this.element = element;
    this.onTarget = onTarget;
    this.grids = new Map();
    this.unit = 1;
  }

  setFeet(feet) {
    this.unit = feet ? FOOT_M : 1;
  }

  // Draw all; returns whether there is any.
  draw(picture) {
    const shown = [...picture.vehicles.values()].filter((vehicle) => vehicle.local_ned !== null);
    const wanted = new Set(shown.map((vehicle) => vehicle.id));
    for (const [id, grid] of this.grids) if (!wanted.has(id)) { grid.figure.remove(); this.grids.delete(id); }
    this.element.hidden = !shown.length;
    for (const vehicle of shown) {
      const grid = this.grids.get(vehicle.id) ?? this.add(vehicle.id);
      grid.figure.style.order = vehicle.number;
      grid.draw(vehicle, picture.localTargets(vehicle.id), picture.now(), this.unit);
    }
    return shown.length > 0;
  }

  add(id) {
    const grid = new LocalGrid(id, this.onTarget);
    this.grids.set(id, grid);
    this.element.append(grid.figure);
    return grid;
  }

  show(id) {
    this.grids.get(id)?.figure.scrollIntoView({ block: "nearest" });
  }
}

class LocalGrid {
  constructor(id, onTarget) {
    this.figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    caption.textContent = `vehicle ${id}: local grid about its own zero`;
    this.svg = create("svg", { role: "img", "aria-label": `Local grid of vehicle ${id}` });
    this.figure.append(caption, this.svg);
    this.places = [];
    // Marks are drawn again with each report, perhaps between press and release: the grid finds what was tapped.
    this.svg.addEventListener("click", (event) => {
      const box = this.svg.getBoundingClientRect();
      const apart = ({ x, y }) => Math.hypot(x - event.clientX + box.left, y - event.clientY + box.top);
      const [nearest] = this.places.filter((place) => apart(place) <= FINGER_PX).sort((a, b) => apart(a) - apart(b));
      if (nearest) onTarget(nearest.id);
    });
  }

  draw(vehicle, targets, now, unit) {
    this.width = this.svg.clientWidth;
    this.height = this.svg.clientHeight;
    if (!this.width || !this.height) return;
    const places = [vehicle.local_ned, ...targets.map((target) => [target.north_m, target.east_m])];
    const farthest = Math.max(LEAST_REACH_M, ...places.map(([north, east]) => Math.max(Math.abs(north), Math.abs(east))));
    const half = niceStep(farthest * ROOM / unit) * unit;  // in steps, or each move of the vehicle would move all
    this.scale = Math.min(this.width, this.height) / 2 / half;
    const step = niceStep(SPACING_PX / this.scale / unit) * unit;
    const drawn = [...this.lines(step, unit), ...targets.flatMap((target) => this.target(target, now)),
      ...this.vehicle(vehicle, now), ...this.ruler(step, unit)];
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    this.svg.replaceChildren(...drawn);
    this.places = targets.map((target) => ({ id: target.id, ...this.pixel(target.north_m, target.east_m) }));
  }

  // North is up, and the zero in the middle.
  pixel(north, east) {
    return { x: this.width / 2 + east * this.scale, y: this.height / 2 - north * this.scale };
  }

  lines(step, unit) {
    const drawn = [];
    const feet = unit !== 1;
    const most = (pixels) => Math.floor(pixels / 2 / this.scale / step);
    for (let count = -most(this.width); count <= most(this.width); count += 1) {
      const { x } = this.pixel(0, count * step);
      drawn.push(create("line", { x1: x, x2: x, y1: 0, y2: this.height, class: count ? "line" : "line axis" }),
        create("text", { x: x + 3, y: this.height - FOOT_PX, class: "number" }, label(count * step / unit, feet, "E", "W")));
    }
    for (let count = -most(this.height); count <= most(this.height); count += 1) {
      const { y } = this.pixel(count * step, 0);
      drawn.push(create("line", { x1: 0, x2: this.width, y1: y, y2: y, class: count ? "line" : "line axis" }));
      if (!count || y > this.height - 3 * FOOT_PX) continue;  // the axis needs no number; at the foot are those of east
      drawn.push(create("text", { x: 4, y: y - 3, class: "number" }, label(count * step / unit, feet, "N", "S")));
    }
    return drawn;
  }

  target(target, now) {
    const { gone, dashed, paint } = targetMark(target, now);
    const { x, y } = this.pixel(target.north_m, target.east_m);
    const corners = outline(target.ellipse).map(([north, east]) => this.pixel(target.north_m + north, target.east_m + east));
    const colour = `var(${paint})`;
    const said = gone ? `${name(target)} · ${duration(Math.max(0, now - target.seen_unix))} old` : name(target);
    return [
      create("polygon", { points: corners.map((at) => `${at.x.toFixed(1)},${at.y.toFixed(1)}`).join(" "), class: "ellipse",
        fill: colour, stroke: colour, "stroke-dasharray": dashed ? "6 5" : "none", "data-target": target.id }),
      create("circle", { cx: x, cy: y, r: 5, fill: colour, "data-target": target.id }),
      create("text", { x: x + 9, y: y + 4, class: "name" }, said),
    ];
  }

  vehicle(vehicle, now) {
    const { label: said, paint } = vehicleMark(vehicle, vehicle.heard.local ?? vehicle.heard_unix, now);
    const { x, y } = this.pixel(vehicle.local_ned[0], vehicle.local_ned[1]);
    const shape = arrowShape();
    shape.setAttribute("class", "arrow");
    shape.setAttribute("fill", `var(${paint})`);
    shape.setAttribute("transform", `translate(${x} ${y}) rotate(${vehicle.heading_deg ?? 0})`);
    return [shape, create("text", { x, y: y + 26, class: "name middle" }, said)];
  }

  // A bar of one step of the grid.
  ruler(step, unit) {
    const right = this.width - 12;
    const left = right - step * this.scale;
    return [
      create("path", { d: `M${left},10 V16 H${right} V10`, class: "ruler" }),
      create("text", { x: right, y: 30, class: "number end" }, label(step / unit, unit !== 1, "", "").trim()),
    ];
  }
}

function create(tag, attributes, content = "") {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = content;
  return element;
}
