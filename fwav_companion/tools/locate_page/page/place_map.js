// The map: where the pictures were taken and look to, and the places with their 95 % ellipses.
import { moved } from "./ellipse.js";
import { Graticule } from "./graticule.js";

const L = window.L;
const MAX_ZOOM = 24;
const LOOK_M = 8;

export class PlaceMap {
  constructor(element, { onPicture, onTarget }) {
    this.map = L.map(element, { center: [0, 0], zoom: 2, maxZoom: MAX_ZOOM, zoomSnap: 0.5,
      renderer: L.canvas({ tolerance: 12, padding: 0.3 }) });
    this.map.attributionControl.setPrefix("Leaflet");
    this.map.createPane("graticule").style.zIndex = 250;
    L.control.scale({ imperial: false, maxWidth: 160 }).addTo(this.map);
    this.graticule = new Graticule([0, 0]).addTo(this.map);
    this.cameras = L.layerGroup().addTo(this.map);
    this.places = L.layerGroup().addTo(this.map);
    this.handlers = { onPicture, onTarget };
    new ResizeObserver(() => this.map.invalidateSize()).observe(element);
  }

  addTiles(info) {
    const options = { minNativeZoom: info.min_zoom, maxNativeZoom: info.max_zoom, maxZoom: MAX_ZOOM,
      attribution: text(info.attribution).innerHTML };
    if (info.bounds.length === 4) {
      const [west, south, east, north] = info.bounds;
      options.bounds = [[south, west], [north, east]];
    }
    L.tileLayer("tiles/{z}/{x}/{y}", options).addTo(this.map);
  }

  drawPictures(pictures, shown) {
    this.cameras.clearLayers();
    this.at = pictures.map((picture) => [picture.lat, picture.lon]);
    for (const picture of pictures) {
      const isShown = picture.file === shown;
      const place = [picture.lat, picture.lon];
      const yaw = picture.yaw_deg * Math.PI / 180;
      const paint = colour("--vehicle");
      const style = { color: paint, fillColor: paint, weight: isShown ? 4 : 2, fillOpacity: isShown ? 1 : 0.2 };
      L.polyline([place, moved(place, LOOK_M * Math.cos(yaw), LOOK_M * Math.sin(yaw))], style).addTo(this.cameras);
      L.circleMarker(place, { ...style, radius: isShown ? 7 : 5 }).addTo(this.cameras)
        .on("click", () => this.handlers.onPicture(picture.file));
    }
  }

  drawPlaces(state, current, colours) {
    this.places.clearLayers();
    this.found = [];
    for (const target of state.answers.targets) {
      const paint = colours(target.label);
      const style = { color: paint, fillColor: paint, weight: target.label === current ? 4 : 2, smoothFactor: 0 };
      const choose = () => this.handlers.onTarget(target.label);
      const ellipse = L.polygon(target.outline, { ...style, fillOpacity: 0.15 }).addTo(this.places).on("click", choose);
      L.circleMarker([target.lat, target.lon], { ...style, radius: 4, fillOpacity: 0.9 }).addTo(this.places)
        .bindTooltip(text(target.label), { permanent: true, direction: "right", className: "name" }).on("click", choose);
      this.found.push([target.lat, target.lon], ellipse.getBounds().getNorthEast(), ellipse.getBounds().getSouthWest());
    }
  }

  fit() {
    const places = [...(this.at ?? []), ...(this.found ?? [])];
    if (!places.length) return;
    this.graticule.setOrigin(this.at[0]);
    this.map.fitBounds(L.latLngBounds(places).pad(0.2), { maxZoom: 20, animate: false });
  }
}

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function text(value) {
  const element = document.createElement("span");
  element.textContent = value;
  return element;
}
