// What the map and the local grids draw alike: an arrow, its label with an age, a target's colour.
import { duration } from "./format.js";
import { isGone, isOld } from "./health.js";

export const SVG = "http://www.w3.org/2000/svg";
const ARROW = "M0,-13 L9,10 L0,5 L-9,10 Z";
const UNSURE = ["coasting", "tentative", "reported"];

// An arrow that points north, 26 pixels long.
export function arrowShape() {
  const shape = document.createElementNS(SVG, "path");
  shape.setAttribute("d", ARROW);
  shape.setAttribute("stroke", "white");
  shape.setAttribute("stroke-width", "1.5");
  return shape;
}

// {old, label, paint}: grey with its age where the place, of the instant `placed`, is old: the vehicle may be elsewhere.
export function vehicleMark(vehicle, placed, now) {
  const old = isOld(placed, now);
  const label = old ? `${vehicle.id} · ${duration(now - placed)} old` : vehicle.id;
  return { old, label, paint: old ? "--old" : `--v${vehicle.number % 8}` };
}

// {gone, dashed, paint} of a target: grey where it has not been seen for a while, dashed where its place is unsure.
export function targetMark(target, now) {
  const gone = isGone(target, now);
  const unsure = UNSURE.includes(target.state);
  return { gone, dashed: gone || unsure, paint: gone ? "--old" : unsure ? "--coasting" : "--target" };
}
