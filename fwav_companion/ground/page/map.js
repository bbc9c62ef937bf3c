// The map: vehicles with heading, path and footprint; targets with their 95 % ellipses.
import { corners } from "./ellipse.js";
import { name } from "./format.js";
import { Graticule } from "./graticule.js";
import { arrowShape, SVG, targetMark, vehicleMark } from "./marks.js";

const L = window.L;
const START = [0, 0];
const FIRST_ZOOM = 18;
const MAX_ZOOM = 24;
const FINGER_PX = 12;
const MAX_NAMES = 60;
const MAX_TRAIL = 150;

export class PictureMap {
  constructor(element, { onTarget, onClick }) {
    this.map = L.map(element, {
      center: START, zoom: 2, maxZoom: MAX_ZOOM, zoomSnap: 0.5, worldCopyJump: true, zoomControl: false,
      renderer: L.canvas({ tolerance: FINGER_PX, padding: 0.3 }),
    });
    this.map.attributionControl.setPrefix("Leaflet");
    this.map.createPane("graticule").style.zIndex = 250;
    const vehicles = this.map.createPane("vehicles");  // above the names of targets and of the point (Leaflet's 650)
    vehicles.style.zIndex = 660;
    vehicles.style.pointerEvents = "none";
    L.control.zoom({ position: "bottomright" }).addTo(this.map);  // where a thumb reaches it
    this.graticule = new Graticule(START).addTo(this.map);
    this.onTarget = onTarget;
    this.map.on("click", (event) => onClick([event.latlng.lat, event.latlng.lng]));
    this.map.on("movestart", (event) => { this.moved ||= !this.fitting; });
    this.vehicles = new Map();
    this.targets = new Map();
    this.history = L.polyline([], { weight: 2, dashArray: "4 4" }).addTo(this.map);
    this.fitted = false;
    new ResizeObserver(() => this.map.invalidateSize()).observe(element);
  }

  addTiles(info) {
    const options = { minNativeZoom: info.min_zoom, maxNativeZoom: info.max_zoom, maxZoom: MAX_ZOOM,
      attribution: text(info.attribution) };
    if (info.bounds.length === 4) {
      const [west, south, east, north] = info.bounds;
      options.bounds = [[south, west], [north, east]];
    }
    L.tileLayer("tiles/{z}/{x}/{y}", options).addTo(this.map);
  }

  setFeet(feet) {
    this.scale?.remove();
    this.scale = L.control.scale({ metric: !feet, imperial: feet, maxWidth: 160 }).addTo(this.map);
    this.graticule.setFeet(feet);
  }

  setPoint(place) {
    this.graticule.setOrigin(place);
    this.pointMark ??= L.circleMarker(place, { radius: 7, weight: 3, fillOpacity: 0, interactive: false })
      .bindTooltip("point", { permanent: true, direction: "right", className: "name" }).addTo(this.map);
    this.pointMark.setLatLng(place).setStyle({ color: colour("--text") });
  }

  draw(picture, changes) {
    for (const id of changes.removed) this.removeTarget(id);
    for (const id of changes.targets) this.drawTarget(picture.targets.get(id), picture.now());
    for (const id of changes.vehicles) this.drawVehicle(id, picture);
    this.showNames();
    if (!this.fitted && (this.vehicles.size || this.targets.size)) this.fit();
  }

  // Recolour everything: a target becomes old without an event, and the theme may change.
  restyle(picture) {
    const now = picture.now();
    for (const target of picture.targets.values()) this.styleTarget(target, now);
    for (const vehicle of picture.vehicles.values()) this.styleVehicle(vehicle, now);
    if (this.theme === colour("--vehicle")) return;
    this.theme = colour("--vehicle");
    this.history.setStyle({ color: colour("--target") });
    this.pointMark?.setStyle({ color: colour("--text") });
    this.graticule.draw();
  }

  fit() {
    const places = [...this.targets.values()].map((marks) => marks.centre.getLatLng());
    for (const marks of this.vehicles.values()) places.push(marks.arrow.getLatLng());
    if (!places.length) return;
    this.fitted = true;
    this.fitting = true;
    this.map.fitBounds(L.latLngBounds(places).pad(0.25), { maxZoom: FIRST_ZOOM + 2, animate: false });
    this.fitting = false;
  }

  showHistory(points) {
    this.history.setLatLngs(points.map((point) => [point[1], point[2]])).setStyle({ color: colour("--target") });
  }

  drawTarget(target, now) {
    if (!target || target.lat === null) return;  // without a place on the earth it is on a local grid
    const place = [target.lat, target.lon];
    const outline = target.ellipse ? corners(place, target.ellipse) : [];
    let marks = this.targets.get(target.id);
    if (!marks) {
      const centre = L.circleMarker(place, { radius: 5, weight: 2, fillOpacity: 0.9 }).addTo(this.map);
      const ellipse = L.polygon(outline, { weight: 2, fillOpacity: 0.15, smoothFactor: 0 }).addTo(this.map);
      const choose = (event) => { L.DomEvent.stopPropagation(event); this.onTarget(target.id); };
      centre.on("click", choose);
      ellipse.on("click", choose);
      marks = { centre, ellipse, named: false };
      this.targets.set(target.id, marks);
    }
    marks.label = name(target);
    marks.centre.setLatLng(place);
    marks.ellipse.setLatLngs(outline);
    this.styleTarget(target, now);
  }

  styleTarget(target, now) {
    const marks = this.targets.get(target.id);
    if (!marks) return;
    const { paint: style, dashed } = targetMark(target, now);
    if (marks.style === style + colour(style)) return;
    marks.style = style + colour(style);
    const paint = colour(style);
    marks.centre.setStyle({ color: paint, fillColor: paint });
    marks.ellipse.setStyle({ color: paint, fillColor: paint, dashArray: dashed ? "6 5" : null });
  }

  removeTarget(id) {
    const marks = this.targets.get(id);
    if (!marks) return;
    marks.centre.remove();
    marks.ellipse.remove();
    this.targets.delete(id);
  }

  drawVehicle(id, picture) {
    const vehicle = picture.vehicles.get(id);
    if (!vehicle) {
      const marks = this.vehicles.get(id);
      if (marks) for (const mark of [marks.arrow, marks.path, marks.footprint]) mark.remove();
      this.vehicles.delete(id);
      return;
    }
    if (vehicle.lat === null || vehicle.lon === null) return;
    const place = [vehicle.lat, vehicle.lon];
    let marks = this.vehicles.get(id);
    if (!marks) {
      const { icon, shape } = arrow();
      marks = {
        shape,
        footprint: L.polygon([], { weight: 1, fillOpacity: 0.08, interactive: false }).addTo(this.map),
        path: L.polyline([], { weight: 2, opacity: 0.7, interactive: false }).addTo(this.map),
        arrow: L.marker(place, { icon, interactive: false, pane: "vehicles" }).addTo(this.map)
          .bindTooltip(text(id), { permanent: true, direction: "bottom", offset: [0, 10], className: "name", pane: "vehicles" }),
      };
      this.vehicles.set(id, marks);
    }
    marks.arrow.setLatLng(place);
    marks.shape.setAttribute("transform", `rotate(${vehicle.heading_deg ?? 0})`);
    this.styleVehicle(vehicle, picture.now());
    marks.path.setLatLngs((picture.paths.get(id) ?? []).slice(-MAX_TRAIL));
    marks.footprint.setLatLngs(vehicle.footprint);
  }

  styleVehicle(vehicle, now) {
    const marks = this.vehicles.get(vehicle.id);
    if (!marks) return;
    const { old, label, paint: variable } = vehicleMark(vehicle, vehicle.heard.position ?? vehicle.heard_unix, now);
    if (marks.label !== label) {
      marks.label = label;
      marks.arrow.setTooltipContent(text(label));
    }
    const paint = colour(variable);
    if (marks.paint === paint) return;
    marks.paint = paint;
    marks.shape.setAttribute("fill", paint);
    marks.path.setStyle({ color: paint });
    marks.footprint.setStyle({ color: paint, opacity: old ? 0 : 1, fillOpacity: old ? 0 : 0.08 });
  }

  // Names only while they can be read.
  showNames() {
    const show = this.targets.size <= MAX_NAMES;
    for (const marks of this.targets.values()) {
      if (show === Boolean(marks.named) && (!show || marks.named === marks.label)) continue;
      marks.centre.unbindTooltip();
      if (show) {
        marks.centre.bindTooltip(text(marks.label),
          { permanent: true, direction: "right", offset: [8, 0], className: "name" });
      }
      marks.named = show ? marks.label : false;
    }
  }
}

// Leaflet reads strings as HTML: names come from radios.
function text(content) {
  const element = document.createElement("span");
  element.textContent = content;
  return element.innerHTML;
}

function arrow() {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "-16 -16 32 32");
  svg.setAttribute("width", "32");
  svg.setAttribute("height", "32");
  const shape = arrowShape();
  svg.append(shape);
  return { icon: L.divIcon({ html: svg, className: "vehicle", iconSize: [32, 32], iconAnchor: [16, 16] }), shape };
}

// Colours of the theme, read once: asking the browser for one costs as much as drawing a target.
const colours = new Map();

function colour(variable) {
  if (colours.theme !== document.documentElement.dataset.theme) {
    colours.clear();
    colours.theme = document.documentElement.dataset.theme;
  }
  if (!colours.has(variable)) {
    colours.set(variable, getComputedStyle(document.documentElement).getPropertyValue(variable).trim());
  }
  return colours.get(variable);
}
