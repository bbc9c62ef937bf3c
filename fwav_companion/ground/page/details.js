// The selected target: position in every form, accuracy, history, copy.
import { age, clock, name } from "./format.js";
import { accuracy, contradiction } from "./health.js";
import { fromPoint, seenBy } from "./list.js";
import { height, length, whereabouts } from "./units.js";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 400;
const HEIGHT = 90;

export class Details {
  constructor(element, { onClose }) {
    this.element = element;
    this.onClose = onClose;
    this.id = null;
    this.points = [];
    this.build();
  }

  build() {
    const heading = document.createElement("h2");
    this.title = document.createElement("span");
    const close = button("×", () => this.onClose());
    close.setAttribute("aria-label", "Close");
    heading.append(this.title, close);
    this.facts = document.createElement("dl");
    this.copy = button("Copy position", () => this.copyPosition());
    this.copy.id = "copy";
    this.plot = document.createElementNS(SVG, "svg");
    this.plot.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    this.element.append(heading, this.facts, this.copy, this.plot);
  }

  show(target, point, picture) {
    this.element.hidden = !target;
    if (!target) return;
    const now = picture.now();
    const claim = contradiction(target, picture.vehicles);
    this.target = target;
    this.title.textContent = `${name(target)} (${target.state})`;
    const facts = [
      ["place", whereabouts(target)],
      ["altitude", altitudeOf(target)],
      ["accuracy", this.accuracyOf(target)],
      ["claim", claim ? `contradicted since ${clock(claim.unix)}: ${claim.text}` : "no contradiction known"], ["from point", fromPoint(target, point) || "no point set"],
      ["seen", `${age(Math.max(0, now - target.seen_unix))}, since ${clock(target.first_unix)}`],
      ["by", `${seenBy(target)} (${target.source})`],
    ];
    for (const [vehicle, reason] of Object.entries(target.left_out)) facts.push(["left out", `${vehicle}: ${reason}`]);
    this.facts.replaceChildren(...facts.flatMap(([key, value]) => [term("dt", key), term("dd", value)]));
  }

  accuracyOf(target) {
    const ellipse = target.ellipse;
    if (!ellipse || ellipse.major_m === ellipse.minor_m) return accuracy(target);
    const axes = `${length(ellipse.major_m)} x ${length(ellipse.minor_m)}`;
    return `${accuracy(target)}; ellipse ${axes}, long axis at ${ellipse.bearing_deg.toFixed(0)}°`;
  }

  // The radius of the 95 % circle over time.
  showHistory(points) {
    this.points = points.filter((point) => point[3] !== null);
    this.plot.replaceChildren();
    if (this.points.length < 2) return;
    const first = this.points[0][0];
    const span = Math.max(1, this.points[this.points.length - 1][0] - first);
    const most = Math.max(...this.points.map((point) => point[3])) || 1;
    const places = this.points.map((point) =>
      `${((point[0] - first) / span * WIDTH).toFixed(1)},${(HEIGHT - 14 - point[3] / most * (HEIGHT - 30)).toFixed(1)}`);
    const line = document.createElementNS(SVG, "polyline");
    line.setAttribute("points", places.join(" "));
    line.setAttribute("fill", "none");
    line.setAttribute("stroke", "currentColor");
    line.setAttribute("stroke-width", "2");
    this.plot.append(line, label(0, 11, `95 % radius, at most ${length(most)}`), label(0, HEIGHT - 2, clock(first)));
  }

  async copyPosition() {
    const content = whereabouts(this.target);
    const copied = await copyText(content);
    this.copy.textContent = copied ? `Copied ${content}` : `Select and copy: ${content}`;
    setTimeout(() => { this.copy.textContent = "Copy position"; }, 2500);
  }
}

function altitudeOf(target) {
  if (target.lat === null) return `${height(-target.down_m)} above the zero`;
  return target.alt_amsl === null ? "unknown" : `${height(target.alt_amsl)} above sea level`;
}

// The clipboard API exists only on loopback and over HTTPS; elsewhere the old command still works.
async function copyText(content) {
  try {
    await navigator.clipboard.writeText(content);
    return true;
  } catch {
    const area = document.createElement("textarea");
    area.value = content;
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    return done;
  }
}

function button(text, onClick) {
  const element = document.createElement("button");
  element.type = "button";
  element.textContent = text;
  element.addEventListener("click", onClick);
  return element;
}

function term(tag, text) {
  const element = document.createElement(tag);
  element.textContent = text;
  return element;
}

function label(x, y, content) {
  const element = document.createElementNS(SVG, "text");
  element.setAttribute("x", x);
  element.setAttribute("y", y);
  element.textContent = content;
  return element;
}
