// One picture to click in: the clicks of all targets, and where they should be by the places so far.
const L = window.L;
const TAP_PX = 9;

export class PictureView {
  constructor(element, { onClick }) {
    this.map = L.map(element, { crs: L.CRS.Simple, minZoom: -6, maxZoom: 5, zoomSnap: 0.25, attributionControl: false,
      fadeAnimation: false });  // a name that fades would stand in the next picture
    this.map.on("click", (event) => this.shown && onClick(event.latlng.lng, -event.latlng.lat));
    this.marks = L.layerGroup().addTo(this.map);
    new ResizeObserver(() => this.map.invalidateSize()).observe(element);
  }

  // Pixel (0, 0) is the middle of the top left pixel: the picture spans -0.5 to its size - 0.5.
  show(picture) {
    if (this.shown?.file === picture.file) return;
    const bounds = [[-(picture.height - 0.5), -0.5], [0.5, picture.width - 0.5]];
    const keeps = this.shown && this.shown.width === picture.width && this.shown.file.includes("@");
    this.shown = picture;
    this.image?.remove();
    this.image = L.imageOverlay(`picture/${encodeURIComponent(picture.file)}`, bounds, { alt: picture.file })
      .addTo(this.map);
    this.map.setMaxBounds(L.latLngBounds(bounds).pad(0.5));
    if (!keeps) this.map.fitBounds(bounds, { animate: false });
  }

  draw(state, current, colours) {
    this.marks.clearLayers();
    if (!this.shown) return;
    const { file, width, height } = this.shown;
    const lost = new Set(state.without_place.map((each) => `${each.file}|${each.pixel}`));
    for (const target of state.answers.targets) {
      const style = { color: colours(target.label), weight: 2, dashArray: "5 5", fillOpacity: 0.1, interactive: false };
      for (const each of target.expected.filter((one) => one.file === file)) {
        const outline = each.outline.map(([u, v]) => [-clamp(v, height), clamp(u, width)]);
        L.polygon(outline, style).addTo(this.marks).bindTooltip(text(`${target.label}?`), NAME);
        L.circleMarker([-each.v, each.u], { ...style, radius: 3 }).addTo(this.marks);
      }
      for (const each of target.pictures.filter((one) => one.file === file && one.u !== null)) {
        L.circleMarker([-each.v, each.u], { ...style, radius: 4, dashArray: null }).addTo(this.marks);
      }
    }
    for (const click of state.clicks.filter((each) => each.file === file)) {
      const [u, v] = click.pixel;
      const bad = lost.has(`${file}|${click.pixel}`);
      const style = { color: colours(click.label), weight: click.label === current ? 3 : 2, interactive: false,
        fillOpacity: 0, radius: TAP_PX, dashArray: bad ? "3 4" : null };
      L.circleMarker([-v, u], style).addTo(this.marks).bindTooltip(text(click.label), NAME);
      for (const line of cross(this.map, u, v)) L.polyline(line, { ...style, weight: 1 }).addTo(this.marks);
    }
  }
}

const NAME = { permanent: true, direction: "right", offset: [10, 0], className: "name" };

// An ellipse near the horizon reaches far: beyond some widths of the picture it is not drawn.
function clamp(value, size) {
  return Math.max(-4 * size, Math.min(5 * size, value));
}

function cross(map, u, v) {
  const reach = 5 / 2 ** map.getZoom();
  return [[[-v, u - reach], [-v, u + reach]], [[-v - reach, u], [-v + reach, u]]];
}

function text(value) {
  const element = document.createElement("span");
  element.textContent = value;
  return element;
}
