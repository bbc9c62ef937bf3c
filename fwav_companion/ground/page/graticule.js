// A grid of metres north and east of the operator's point, drawn under everything. It needs no tiles and no network.
import { metresPerDegree } from "./ellipse.js";

const SPACING_PX = 110;
const L = window.L;

export const Graticule = L.Layer.extend({
  initialize(origin) {
    this.origin = origin;
    this.feet = false;
  },

  // Lines at whole feet instead of whole metres.
  setFeet(feet) {
    this.feet = feet;
    if (this._map) this.draw();
  },

  onAdd(map) {
    this.canvas = L.DomUtil.create("canvas", "graticule leaflet-zoom-hide", map.getPane("graticule"));
    map.on("move zoomend resize viewreset", this.draw, this);
    this.draw();
  },

  onRemove(map) {
    map.off("move zoomend resize viewreset", this.draw, this);
    this.canvas.remove();
  },

  setOrigin(origin) {
    this.origin = origin;
    if (this._map) this.draw();
  },

  draw() {
    const map = this._map;
    const size = map.getSize();
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = size.x * ratio;
    this.canvas.height = size.y * ratio;
    this.canvas.style.width = `${size.x}px`;
    this.canvas.style.height = `${size.y}px`;
    L.DomUtil.setPosition(this.canvas, map.containerPointToLayerPoint([0, 0]));
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(document.documentElement);
    pen.strokeStyle = style.getPropertyValue("--grid");
    pen.fillStyle = style.getPropertyValue("--quiet");
    pen.font = "11px system-ui, sans-serif";
    this.lines(pen, size);
  },

  lines(pen, size) {
    const map = this._map;
    const scale = metresPerDegree(this.origin[0]);
    const bounds = map.getBounds();
    const across = (bounds.getEast() - bounds.getWest()) * scale.east;
    const unit = this.feet ? 0.3048 : 1;
    const step = niceStep(across * SPACING_PX / size.x / unit) * unit;
    const east = [(bounds.getWest() - this.origin[1]) * scale.east, (bounds.getEast() - this.origin[1]) * scale.east];
    const north = [(bounds.getSouth() - this.origin[0]) * scale.north,
      (bounds.getNorth() - this.origin[0]) * scale.north];
    for (let at = Math.ceil(east[0] / step) * step; at <= east[1]; at += step) {
      const x = map.latLngToContainerPoint([this.origin[0], this.origin[1] + at / scale.east]).x;
      line(pen, [x, 0], [x, size.y], Math.abs(at) < step / 2);
      pen.fillText(label(at / unit, this.feet, "E", "W"), x + 4, size.y - 22);
    }
    for (let at = Math.ceil(north[0] / step) * step; at <= north[1]; at += step) {
      const y = map.latLngToContainerPoint([this.origin[0] + at / scale.north, this.origin[1]]).y;
      line(pen, [0, y], [size.x, y], Math.abs(at) < step / 2);
      pen.fillText(label(at / unit, this.feet, "N", "S"), 56, y - 4);
    }
  },
});

function line(pen, from, to, isAxis) {
  pen.lineWidth = isAxis ? 2 : 1;
  pen.globalAlpha = isAxis ? 0.9 : 0.6;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
  pen.globalAlpha = 1;
}

export function label(value, feet, positive, negative) {
  if (Math.abs(value) < 1e-6) return "0";
  const size = Math.abs(value);
  const whole = feet ? `${+size.toFixed(2)} ft` : size >= 1000 ? `${+(size / 1000).toFixed(3)} km` : `${+size.toFixed(2)} m`;
  return `${whole} ${value > 0 ? positive : negative}`;
}

// The next of 1, 2, 5 times a power of ten.
export function niceStep(metres) {
  const power = 10 ** Math.floor(Math.log10(Math.max(metres, 1e-3)));
  return [1, 2, 5, 10].find((each) => each * power >= metres) * power;
}
