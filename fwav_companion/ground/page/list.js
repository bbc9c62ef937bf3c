// The lists: targets, vehicles and texts. Rows are kept and only their texts change, so that a tap finds its row.
import { offset } from "./ellipse.js";
import { age, bearing, clock, name } from "./format.js";
import { accuracy, contradiction, isGone, isOld, OLD_S, vehicleHealth } from "./health.js";
import { height, length, offsets, place, speed, whereabouts } from "./units.js";

const SEVERE = 4;

export class RowList {
  constructor(element, onRow) {
    this.element = element;
    this.empty = element.querySelector(".empty");
    this.rows = new Map();
    this.onRow = onRow;
  }

  // Entries: {id, title, tag, level, age, lines, old, current, colour}; a line is a list of values {text, unix}.
  show(entries, now) {
    const wanted = new Set(entries.map((entry) => entry.id));
    for (const [id, row] of this.rows) if (!wanted.has(id)) { row.button.remove(); this.rows.delete(id); }
    let next = this.empty.nextElementSibling;
    for (const entry of entries) {
      const row = this.rows.get(entry.id) ?? this.addRow(entry.id);
      this.fill(row, entry, now);
      if (row.button === next) next = next.nextElementSibling;
      else this.element.insertBefore(row.button, next);
    }
    this.empty.hidden = entries.length > 0;
  }

  addRow(id) {
    const button = create("button", "row");
    button.type = "button";
    const head = create("span", "head");
    const row = { button, swatch: create("span"), title: create("span"), tag: create("span"),
      age: create("span", "age"), lines: [] };
    head.append(row.swatch, row.title, row.tag, row.age);
    button.append(head);
    button.addEventListener("click", () => this.onRow(id));
    this.rows.set(id, row);
    return row;
  }

  fill(row, entry, now) {
    row.swatch.className = `swatch v${entry.colour}`;
    row.swatch.hidden = entry.colour === undefined;
    setText(row.title, entry.title);
    setText(row.tag, entry.tag);
    row.tag.className = `tag ${entry.level}`;
    setText(row.age, entry.age);
    row.button.classList.toggle("old", entry.old);
    row.button.setAttribute("aria-current", String(entry.current));
    while (row.lines.length < entry.lines.length) {
      const line = create("span", "line");
      row.button.append(line);
      row.lines.push(line);
    }
    row.lines.forEach((line, index) => fillLine(line, (entry.lines[index] ?? []).filter((value) => value.text), now));
  }
}

// A value that is older than OLD_S is grey and has its age.
function fillLine(line, values, now) {
  while (line.children.length > values.length) line.lastElementChild.remove();
  while (line.children.length < values.length) line.append(create("span"));
  values.forEach((value, index) => {
    const shown = line.children[index];
    const old = value.unix !== undefined && isOld(value.unix, now);
    shown.className = `value${old ? " stale" : ""}${value.level ? ` ${value.level}` : ""}`;
    setText(shown, old && value.unix !== null ? `${value.text} (${age(now - value.unix)})` : value.text);
    const when = value.unix ? clock(value.unix) : "";
    if (shown.title !== when) shown.title = when;
  });
  line.hidden = !values.length;
}

export function targetEntries(picture, point, selected) {
  const now = picture.now();
  return [...picture.targets.values()]
    .sort((a, b) => a.first_unix - b.first_unix || a.id.localeCompare(b.id))
    .map((target) => {
      const gone = isGone(target, now);
      const unix = target.seen_unix;
      const claim = contradiction(target, picture.vehicles);
      return {
        id: target.id, title: name(target), tag: isOld(unix, now) ? `was ${target.state}` : target.state,
        level: gone ? "old" : target.state, age: age(Math.max(0, now - unix)), old: gone,
        current: target.id === selected,
        lines: [
          [{ text: accuracy(target), level: "claim" }, { text: fromPoint(target, point) }],
          claim ? [{ text: `contradicted since ${clock(claim.unix)}: ${claim.text}`, level: "bad" }] : [],
          [{ text: whereabouts(target) }],
          [{ text: `since ${clock(target.first_unix)}` }, { text: seenBy(target) }],
        ],
      };
    });
}

export function fromPoint(target, point) {
  if (!point || target.lat === null) return "";
  const { north, east } = offset(point, [target.lat, target.lon]);
  return `${length(Math.hypot(north, east))} at ${bearing(north, east)} from point`;
}

export function seenBy(target) {
  const vehicles = Object.keys(target.vehicles);
  return vehicles.length ? `seen by ${vehicles.join(", ")}` : `vehicle ${target.vehicle}`;
}

export function vehicleEntries(picture) {
  const now = picture.now();
  return [...picture.vehicles.values()].sort((a, b) => a.id.localeCompare(b.id, undefined, { numeric: true }))
    .map((vehicle) => {
      const health = vehicleHealth(vehicle, now);
      const { autopilot, companion, position, local, attitude, battery, gps } = vehicle.heard;
      return {
        id: vehicle.id, title: `vehicle ${vehicle.id}`, tag: health.word, level: health.level,
        age: age(Math.max(0, now - vehicle.heard_unix)), old: isOld(vehicle.heard_unix, now), current: false,
        colour: colourOf(vehicle),
        lines: [
          [{ text: health.text, level: health.level === "good" ? "" : health.level }],
          [{ text: vehicle.kind }, { text: armed(vehicle), unix: autopilot ?? companion ?? null },
            { text: vehicle.gps, unix: gps }, { text: batteryText(vehicle), unix: battery }],
          [placeOnEarth(vehicle), vehicle.local_ned === null ? {}
            : { text: `local: ${offsets(...vehicle.local_ned)}, ${height(-vehicle.local_ned[2])} above its zero`, unix: local }],
          [{ text: vehicle.height_m === null ? "" : `${height(vehicle.height_m)} above home`, unix: position },
            { text: vehicle.speed_m_s === null ? "" : speed(vehicle.speed_m_s), unix: position },
            { text: vehicle.heading_deg === null ? "" : `heading ${vehicle.heading_deg.toFixed(0)}°`,
              unix: attitude ?? position ?? local }],
          [companion === undefined ? { text: "companion: not heard" }
            : { text: `companion: ${vehicle.companion ?? "heard"}`, unix: companion }],
          [{ text: vehicle.readiness, unix: readinessUnix(vehicle) }],
          ...vehicle.checks.map((check) => [{ text: check, unix: companion }]),
        ],
      };
    });
}

function placeOnEarth(vehicle) {
  if (vehicle.lat !== null) return { text: place(vehicle.lat, vehicle.lon), unix: vehicle.heard.position ?? vehicle.heard_unix };
  return { text: vehicle.local_ned === null ? "no position yet" : "" };
}

// A report of readiness holds while the parts that it is about are heard; after a silence it is what was said once.
function readinessUnix(vehicle) {
  if (vehicle.ready === null) return Math.min(vehicle.heard.readiness ?? 0, (vehicle.ready_unix ?? 0) - OLD_S);
  const parts = ["autopilot", "companion"].map((part) => vehicle.heard[part]).filter((unix) => unix !== undefined);
  return parts.length ? Math.min(...parts) : vehicle.heard.readiness;
}

export function textEntries(picture) {
  return [...picture.texts].reverse().map((text) => ({
    id: String(text.revision), title: text.text, tag: "", level: "", age: clock(text.time_unix), old: false,
    current: false, colour: colourOf(picture.vehicles.get(text.vehicle)),
    lines: [[{ text: `vehicle ${text.vehicle}` }, { text: text.severity <= SEVERE ? "warning" : "", level: "bad" }]],
  }));
}

function colourOf(vehicle) {
  return vehicle && vehicle.number % 8;
}

function armed(vehicle) {
  if (vehicle.armed === null) return "";
  return vehicle.armed ? "armed" : "disarmed";
}

function batteryText(vehicle) {
  const percent = vehicle.battery_percent === null ? "" : ` ${vehicle.battery_percent} %`;
  return vehicle.battery_v === null ? percent.trim() : `battery ${vehicle.battery_v.toFixed(1)} V${percent}`;
}

function create(tag, className = "") {
  const element = document.createElement(tag);
  element.className = className;
  return element;
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
