// The targets as rows: place, altitude with its datum, accuracy, what limits it, and how well each click agrees.
import { latLon } from "./format.js";

const FAR_SIGMAS = 3;
const CAUSES = { pixel: "the click", own_position: "each picture's position", own_attitude: "each picture's attitude",
  shared_position: "the position shared by all pictures", shared_height: "the height shared by all pictures",
  mount: "the camera's alignment", heading: "the heading", focal: "the focal length", ground: "the ground's height",
  delay: "the delay of the video's telemetry" };

export class TargetList {
  constructor(element, { onTarget }) {
    this.element = element;
    this.empty = element.querySelector(".empty");
    this.handlers = { onTarget };
  }

  show(state, current, colours) {
    const labels = [...new Set(state.clicks.map((click) => click.label))];
    const rows = labels.map((label) => {
      const target = state.answers.targets.find((each) => each.label === label);
      const refused = state.without_place.filter((each) =>
        state.clicks.some((click) => click.label === label && click.file === each.file &&
          String(click.pixel) === String(each.pixel)));
      return this.row(label, target, refused, label === current, colours(label));
    });
    this.element.replaceChildren(this.empty, ...rows);
    this.empty.hidden = rows.length > 0;
  }

  row(label, target, refused, isCurrent, colour) {
    const button = create("button", "row");
    button.type = "button";
    button.dataset.label = label;
    button.setAttribute("aria-current", String(isCurrent));
    const head = create("span", "head");
    const swatch = create("span", "swatch");
    swatch.style.background = colour;
    head.append(swatch, create("span", "", label));
    button.append(head);
    const lines = target ? lines95(target) : [];
    lines.push(...refused.map((each) => `${each.file}: no place: ${this.reasons[each.reason]}`));
    for (const line of lines) button.append(create("span", "line", line));
    button.addEventListener("click", () => this.onTarget(label));
    return button;
  }
}

function lines95(target) {
  const heights = [];
  if (target.alt_amsl !== null) heights.push(`${target.alt_amsl.toFixed(1)} m above sea level (EGM96)`);
  if (target.alt_takeoff !== null) heights.push(`${signed(target.alt_takeoff)} m from the take-off`);
  const far = target.pictures.filter((each) => each.sigmas > FAR_SIGMAS);
  return [
    latLon(target.lat, target.lon),
    target.mgrs ?? "",
    `${heights.join(", ")}, ± ${target.height95_m.toFixed(1)} m`,
    `95 % within ${target.radius95_m.toFixed(2)} m; ${target.pictures.length} ${
      target.pictures.length === 1 ? "picture" : "pictures"}`,
    `limited by ${CAUSES[target.dominant]} (${Math.round(100 * target.dominant_share)} %)`,
    ...far.map((each) => `${each.file}: ${each.sigmas.toFixed(1)} sigma off: check this click`),
  ].filter(Boolean);
}

function signed(value) {
  const shown = value.toFixed(1);
  return Number(shown) === 0 ? "0.0" : value > 0 ? `+${shown}` : shown;
}

function create(tag, className = "", content = "") {
  const element = document.createElement(tag);
  element.className = className;
  element.textContent = content;
  return element;
}
