// Metres or feet, degrees or MGRS: one switch, which the browser remembers.
import { latLon, mgrs } from "./format.js";

const FEET_A_METRE = 1 / 0.3048;
const CHOICES = [
  { feet: false, mgrs: false, name: "m · °" },
  { feet: false, mgrs: true, name: "m · MGRS" },
  { feet: true, mgrs: false, name: "ft · °" },
  { feet: true, mgrs: true, name: "ft · MGRS" },
];

let chosen = 0;

export function units() {
  return CHOICES[chosen];
}

// What is stored may be anything: an older page's, or none.
export function chooseUnits(index) {
  chosen = Number.isInteger(index) ? ((index % CHOICES.length) + CHOICES.length) % CHOICES.length : 0;
  return chosen;
}

export function nextUnits() {
  return chooseUnits(chosen + 1);
}

export function length(metres) {
  if (metres === null || metres === undefined) return "unknown";
  const value = CHOICES[chosen].feet ? metres * FEET_A_METRE : metres;
  const digits = value >= 9.95 ? 0 : CHOICES[chosen].feet ? 1 : 2;
  return `${value.toFixed(digits)} ${CHOICES[chosen].feet ? "ft" : "m"}`;
}

export function height(metres) {
  return CHOICES[chosen].feet ? `${(metres * FEET_A_METRE).toFixed(0)} ft` : `${metres.toFixed(1)} m`;
}

export function speed(metresPerSecond) {
  const value = CHOICES[chosen].feet ? metresPerSecond * FEET_A_METRE : metresPerSecond;
  return `${value.toFixed(1)} ${CHOICES[chosen].feet ? "ft/s" : "m/s"}`;
}

// Where a target is: on the earth, or from the zero of its vehicle's local world.
export function whereabouts(target) {
  if (target.lat !== null) return place(target.lat, target.lon);
  return `${offsets(target.north_m, target.east_m)} of the zero of vehicle ${target.vehicle}`;
}

export function offsets(north, east) {
  return `${length(Math.abs(north))} ${north < 0 ? "S" : "N"}, ${length(Math.abs(east))} ${east < 0 ? "W" : "E"}`;
}

// Near the poles MGRS is not defined: degrees then.
export function place(lat, lon) {
  return (CHOICES[chosen].mgrs && mgrs(lat, lon)) || latLon(lat, lon);
}
