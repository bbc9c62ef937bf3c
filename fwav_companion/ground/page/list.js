// The lists: targets, vehicles and texts. Rows are kept and only their texts change, so that a tap finds its row.
import { offset } from "./ellipse.js";
import { age, bearing, clock, latLon, metres, mgrs, name } from "./format.js";

const OLD_S = 10;
const SEVERE = 4;

export class RowList {
  constructor(element, onRow) {
    this.element = element;
    this.empty = element.querySelector(".empty");
    this.rows = new Map();
    this.onRow = onRow;
  }

  // Entries: {id, title, tag, tagClass, age, lines, old, current}
  show(entries) {
    const wanted = new Set(entries.map((entry) => entry.id));
    for (const [id, row] of this.rows) if (!wanted.has(id)) { row.button.remove(); this.rows.delete(id); }
    let place = this.empty.nextElementSibling;
    for (const entry of entries) {
      const row = this.rows.get(entry.id) ?? this.addRow(entry.id);
      this.fill(row, entry);
      if (row.button === place) place = place.nextElementSibling;
      else this.element.insertBefore(row.button, place);
    }
    this.empty.hidden = entries.length > 0;
  }

  addRow(id) {
    const button = create("button", "row");
    button.type = "button";
    const head = create("span", "head");
    const row = { button, title: create("span"), tag: create("span"), age: create("span", "age"), lines: [] };
    head.append(row.title, row.tag, row.age);
    button.append(head);
    button.addEventListener("click", () => this.onRow(id));
    this.rows.set(id, row);
    return row;
  }

  fill(row, entry) {
    setText(row.title, entry.title);
    setText(row.tag, entry.tag);
    row.tag.className = `tag ${entry.tagClass}`;
    setText(row.age, entry.age);
    row.button.classList.toggle("old", entry.old);
    row.button.setAttribute("aria-current", String(entry.current));
    while (row.lines.length < entry.lines.length) {
      const line = create("span", "line");
      row.button.append(line);
      row.lines.push(line);
    }
    row.lines.forEach((line, index) => {
      setText(line, entry.lines[index] ?? "");
      line.hidden = !entry.lines[index];
    });
  }
}

export function targetEntries(picture, point, selected) {
  const now = picture.now();
  return [...picture.targets.values()]
    .sort((a, b) => a.first_unix - b.first_unix || a.id.localeCompare(b.id))
    .map((target) => {
      const seen = Math.max(0, now - target.seen_unix);
      const ended = target.state === "lost" || target.state === "dropped";
      return {
        id: target.id, title: name(target), tag: target.state, tagClass: seen > OLD_S ? "old" : target.state,
        age: age(seen), old: ended || seen > OLD_S, current: target.id === selected,
        lines: [
          latLon(target.lat, target.lon),
          mgrs(target.lat, target.lon),
          [accuracy(target), fromPoint(target, point), `since ${clock(target.first_unix)}`, seenBy(target)]
            .filter(Boolean).join(" · "),
        ],
      };
    });
}

export function accuracy(target) {
  if (target.radius95_m === null) return "accuracy unknown";
  return `95 % within ${target.bound ? "at most " : ""}${metres(target.radius95_m)}`;
}

export function fromPoint(target, point) {
  if (!point) return "";
  const { north, east } = offset(point, [target.lat, target.lon]);
  return `${metres(Math.hypot(north, east))} at ${bearing(north, east)} from point`;
}

export function seenBy(target) {
  const vehicles = Object.keys(target.vehicles);
  return vehicles.length ? `seen by ${vehicles.join(", ")}` : `vehicle ${target.vehicle}`;
}

export function vehicleEntries(picture) {
  const now = picture.now();
  return [...picture.vehicles.values()].sort((a, b) => a.id.localeCompare(b.id, undefined, { numeric: true }))
    .map((vehicle) => {
      const placed = vehicle.placed_unix === null ? null : Math.max(0, now - vehicle.placed_unix);
      return {
        id: vehicle.id, title: `vehicle ${vehicle.id}`,
        tag: vehicle.silent ? "silent" : vehicle.armed === null ? "" : vehicle.armed ? "armed" : "disarmed",
        tagClass: vehicle.silent ? "old" : "", age: age(Math.max(0, now - vehicle.heard_unix)), old: vehicle.silent,
        current: false,
        lines: [
          [vehicle.kind, vehicle.gps, battery(vehicle)].filter(Boolean).join(" · "),
          vehicle.lat === null ? "no position yet" : `${latLon(vehicle.lat, vehicle.lon)}${old(placed)}`,
          flight(vehicle),
          vehicle.companion ? `companion: ${vehicle.companion}` : "companion: not heard",
          vehicle.readiness ?? "",
          ...vehicle.checks,
        ],
      };
    });
}

export function textEntries(picture) {
  return [...picture.texts].reverse().map((text) => ({
    id: String(text.revision), title: text.text, tag: "", tagClass: "", age: clock(text.time_unix), old: false,
    current: false, lines: [`vehicle ${text.vehicle}${text.severity <= SEVERE ? " · warning" : ""}`],
  }));
}

function battery(vehicle) {
  const percent = vehicle.battery_percent === null ? "" : ` ${vehicle.battery_percent} %`;
  return vehicle.battery_v === null ? percent.trim() : `battery ${vehicle.battery_v.toFixed(1)} V${percent}`;
}

function flight(vehicle) {
  const parts = [];
  if (vehicle.height_m !== null) parts.push(`${vehicle.height_m.toFixed(1)} m above home`);
  if (vehicle.speed_m_s !== null) parts.push(`${vehicle.speed_m_s.toFixed(1)} m/s`);
  if (vehicle.heading_deg !== null) parts.push(`heading ${vehicle.heading_deg.toFixed(0)}°`);
  return parts.join(" · ");
}

function old(seconds) {
  return seconds !== null && seconds > OLD_S ? ` (${age(seconds)})` : "";
}

function create(tag, className = "") {
  const element = document.createElement(tag);
  element.className = className;
  return element;
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
