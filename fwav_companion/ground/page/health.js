// Is the vehicle well, how sure is the target, is its claim contradicted, since when: never better than its evidence.
import { clock, duration, name } from "./format.js";
import { length } from "./units.js";

export const OLD_S = 5;
const MOST_NAMED = 4;
const ENDED = ["lost", "dropped"];
const WORST_FIRST = ["bad", "warn", "unknown", "good"];

export function isOld(unix, now) {
  return unix === undefined || unix === null || now - unix > OLD_S;
}

// {level, word, text}: level is good | warn | bad | unknown.
export function vehicleHealth(vehicle, now) {
  const silent = silences(vehicle, now);
  if (silent) return { level: "bad", word: "silent", text: silent };
  if (vehicle.contradicted) {
    return { level: "bad", word: "contradicted", text: `${since(vehicle.contradicted_unix)}: ${vehicle.contradicted}` };
  }
  if (vehicle.ready === false) {
    return { level: "warn", word: "not ready", text: `${since(vehicle.ready_unix)}: ${why(vehicle)}` };
  }
  if (vehicle.ready) return { level: "good", word: "ready", text: since(vehicle.ready_unix) };
  const heard = vehicle.heard.companion !== undefined;
  const text = heard ? "not reported yet, or not since a silence" : "no companion is heard";
  return { level: "unknown", word: "readiness unknown", text };
}

// What of a vehicle is silent, and since when; "" where nothing is.
export function silences(vehicle, now) {
  if (isOld(vehicle.heard_unix, now)) return `all silent ${since(vehicle.heard_unix, now)}`;
  return Object.entries(vehicle.quiet).map(([part, at]) => `${part} silent ${since(at, now)}`).join(", ");
}

// The bar: every vehicle with something silent.
export function silenceText(vehicles, now) {
  const said = vehicles.map((vehicle) => [vehicle.id, silences(vehicle, now)]).filter(([, text]) => text);
  const named = said.slice(0, MOST_NAMED).map(([id, text]) => `${id}: ${text}`).join(" · ");
  return said.length > MOST_NAMED ? `${named} · and ${said.length - MOST_NAMED} more vehicles` : named;
}

// {level, text} of all vehicles: the worst one is named.
export function fleetGlance(vehicles, now) {
  if (!vehicles.length) return { level: "unknown", text: "No vehicle yet" };
  const judged = vehicles.map((vehicle) => ({ vehicle, ...vehicleHealth(vehicle, now) }));
  const worst = WORST_FIRST.map((level) => judged.find((each) => each.level === level)).find(Boolean);
  const well = judged.filter((each) => each.level === "good").length;
  const all = vehicles.length > 1 ? `${well} of ${vehicles.length} ready. ` : "";
  const text = worst.word === "silent" ? worst.text : `${worst.word} ${worst.text}`.trim();
  const named = worst.level === "good" && all ? "" : `Vehicle ${worst.vehicle.id} ${text}`;
  return { level: worst.level, text: `${all}${named}`.trim() };
}

export function isGone(target, now) {
  return ENDED.includes(target.state) || isOld(target.seen_unix, now);
}

// {level, text} of one target.
export function targetGlance(target, vehicles, now) {
  if (!target) return { level: "unknown", text: "No target yet" };
  const claim = contradiction(target, vehicles);
  const found = `${name(target)}: ${accuracy(target)}`;
  if (claim) return { level: "bad", text: `${found}, contradicted ${since(claim.unix)}: ${claim.text}` };
  if (isGone(target, now)) return { level: "unknown", text: `${found}, last seen ${since(target.seen_unix, now, "")}` };
  const level = target.radius95_m === null ? "unknown" : "good";
  return { level, text: `${found}, no contradiction known, ${since(target.first_unix)}` };
}

export function accuracy(target) {
  if (target.radius95_m === null) return "accuracy unknown";
  return `95 % within ${target.bound ? "at most " : ""}${length(target.radius95_m)}`;
}

// {text, unix} of what contradicts a target's claim, by itself or by its vehicle; null where nothing does.
export function contradiction(target, vehicles) {
  if (target.contradicted) return { text: target.contradicted, unix: target.contradicted_unix };
  const vehicle = vehicles.get(target.vehicle);
  return vehicle?.contradicted ? { text: vehicle.contradicted, unix: vehicle.contradicted_unix } : null;
}

// The target that an operator wants to know about: the selected one, else the one that is seen, the surest first.
export function chosenTarget(picture, selected) {
  const known = picture.targets.get(selected);
  if (known) return known;
  const now = picture.now();
  const rank = (target) => {
    const order = isGone(target, now) ? 2e9 : target.state === "selected" ? -1e9 : 0;
    return order + (target.radius95_m ?? 1e8);
  };
  const better = (best, each) => (best && rank(best) <= rank(each) ? best : each);
  return [...picture.targets.values()].reduce(better, undefined);
}

function since(unix, now, word = "since ") {
  if (unix === null || unix === undefined) return "";
  return `${word}${clock(unix)}${now === undefined ? "" : ` (${duration(Math.max(0, now - unix))})`}`;
}

function why(vehicle) {
  return (vehicle.readiness ?? "").replace(/^not ready: /, "");
}
