// Numbers and times as people read them.
import { forward } from "./vendor/mgrs.js";

export function age(seconds) {
  return seconds < 1.5 ? "now" : `${duration(seconds)} ago`;
}

// The length of a silence, without the word ago.
export function duration(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${Math.round(seconds / 3600)} h`;
}

export function clock(unix) {
  return new Date(unix * 1000).toLocaleTimeString([], { hour12: false });
}

export function latLon(lat, lon) {
  return `${lat.toFixed(7)}, ${lon.toFixed(7)}`;
}

// MGRS to one metre; beyond 80 S and 84 N it is not defined.
export function mgrs(lat, lon) {
  if (lat < -80 || lat > 84) return "";
  const text = forward([lon, lat], 5);
  return text.replace(/^(\d+[A-Z])([A-Z]{2})(\d{5})(\d{5})$/, "$1 $2 $3 $4");
}

export function bearing(north, east) {
  const degrees = (Math.atan2(east, north) * 180 / Math.PI + 360) % 360;
  return `${degrees.toFixed(0).padStart(3, "0")}°`;
}

export function name(target) {
  const label = target.label || "target";
  return `${label} ${target.track || ""}`.trim();
}
