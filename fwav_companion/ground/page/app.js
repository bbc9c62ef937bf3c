// Joins the parts: the connection fills the picture; map, lists and details show it.
import { Connection } from "./connection.js";
import { Details } from "./details.js";
import { watchExports } from "./exports.js";
import { duration } from "./format.js";
import { LocalGrids } from "./grids.js";
import { chosenTarget, fleetGlance, silenceText, targetGlance } from "./health.js";
import { RowList, targetEntries, textEntries, vehicleEntries } from "./list.js";
import { PictureMap } from "./map.js";
import { Picture } from "./picture.js";
import { chooseUnits, nextUnits, units } from "./units.js";

const LIST_MS = 500;
const HISTORY_MS = 2000;
const TABS = ["targets", "vehicles", "texts"];
const element = (id) => document.getElementById(id);

const picture = new Picture();
let point = stored("point");
let selected = null;
let setsPoint = false;
let scheduled = false;
let lostSeconds = null;

setTheme(stored("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
const map = new PictureMap(element("map"), { onTarget: select, onClick: clicked });
const grids = new LocalGrids(element("grids"), { onTarget: select });
const details = new Details(element("details"), { onClose: () => select(null) });
const lists = {
  targets: new RowList(element("targets"), select),
  vehicles: new RowList(element("vehicles"), showVehicle),
  texts: new RowList(element("texts"), () => {}),
};
if (point) map.setPoint(point);
showUnits(chooseUnits(stored("units")));
watchExports(document.querySelector(".menu"), element("notice"));

const connection = new Connection({
  onPaths: (paths) => { picture.takePaths(paths); schedule(); },
  onPicture: (update) => { picture.takeUpdate(update); schedule(); },
  onState: showState,
});
window.groundPicture = { map: map.map, layers: map, grids, picture, connection };

fetch("settings.json").then((answer) => answer.json()).then((settings) => {
  element("title").textContent = settings.title;
  element("from").textContent = `fwav-companion ${settings.version}${settings.replay ? ", a recording" : ""}.`;
  if (settings.tiles) map.addTiles(settings.tiles);
});
setInterval(showLists, LIST_MS);
setInterval(readHistory, HISTORY_MS);

element("fit").addEventListener("click", () => map.fit());
element("point").addEventListener("click", () => waitForPoint(!setsPoint));
element("theme").addEventListener("click", () => {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  store("theme", document.documentElement.dataset.theme);
  map.restyle(picture);
});
element("units").addEventListener("click", () => {
  store("units", showUnits(nextUnits()));
  showLists();
  readHistory();
});
for (const tab of TABS) element(`tab-${tab}`).addEventListener("click", () => showTab(tab));

// One drawing a frame, however many updates come.
function schedule() {
  if (scheduled) return;
  scheduled = true;
  requestAnimationFrame(() => {
    scheduled = false;
    adoptPoint();
    showViews();
    map.draw(picture, picture.takeChanges());
  });
}

// The map gives its room to the local grids until something has a place on the earth.
function showViews() {
  const onEarth = (each) => each.lat !== null;
  const alone = grids.draw(picture) && ![...picture.vehicles.values(), ...picture.targets.values()].some(onEarth);
  if (element("map").hidden === alone) return;
  element("map").hidden = alone;
  map.map.invalidateSize();
  grids.draw(picture);
}

// Until the operator chooses a point, it is where the first vehicle was.
function adoptPoint() {
  const first = picture.paths.values().next().value?.[0];
  if (!point && first) setPoint(first, false);
}

function showLists() {
  const now = picture.now();
  if (!element("targets").hidden) lists.targets.show(targetEntries(picture, point, selected), now);
  if (!element("vehicles").hidden) lists.vehicles.show(vehicleEntries(picture), now);
  if (!element("texts").hidden) lists.texts.show(textEntries(picture), now);
  glance("well", fleetGlance([...picture.vehicles.values()], now));
  glance("sure", targetGlance(chosenTarget(picture, selected), picture.vehicles, now));
  showWarning(now);
  element("count-targets").textContent = picture.targets.size;
  element("count-vehicles").textContent = picture.vehicles.size;
  details.show(picture.targets.get(selected), point, picture);
  map.restyle(picture);
  grids.draw(picture);
  element("sources").replaceChildren(...picture.sources.map((source) => {
    const item = document.createElement("li");
    item.textContent = `${source.name}: ${source.text}`;
    item.className = source.works ? "good" : "bad";
    return item;
  }));
}

function showState(state, seconds) {
  element("state").dataset.state = state;
  element("state").textContent = state === "live" ? "live" : "no connection";
  lostSeconds = state === "lost" ? seconds : null;
  if (state === "lost") showWarning(picture.now());
}

// The bar: what is silent, and since when.
function showWarning(now) {
  const silent = silenceText([...picture.vehicles.values()], now);
  const text = lostSeconds === null ? silent
    : `No connection to the ground program for ${duration(lostSeconds)}. Everything shown is old.`;
  element("warning").hidden = !text;
  if (element("warning").textContent !== text) element("warning").textContent = text;
}

function glance(id, { level, text }) {
  if (element(id).dataset.level !== level) element(id).dataset.level = level;
  if (element(id).textContent !== text) element(id).textContent = text;
}

function showUnits(index) {
  element("units").textContent = units().name;
  map.setFeet(units().feet);
  grids.setFeet(units().feet);
  return index;
}

function select(id) {
  selected = id;
  map.showHistory([]);
  showLists();
  readHistory();
  const target = picture.targets.get(id);
  if (target && target.lat === null) grids.show(target.vehicle);
  else if (target && !map.map.getBounds().contains([target.lat, target.lon])) map.map.panTo([target.lat, target.lon]);
}

async function readHistory() {
  const asked = selected;
  if (!asked) return;
  const answer = await fetch(`history.json?target=${encodeURIComponent(asked)}`).catch(() => null);
  const points = answer?.ok ? await answer.json() : [];
  if (asked !== selected) return;
  map.showHistory(points);
  details.showHistory(points);
}

function showVehicle(id) {
  const vehicle = picture.vehicles.get(id);
  if (vehicle && vehicle.lat !== null) map.map.panTo([vehicle.lat, vehicle.lon]);
  grids.show(id);
}

function clicked(place) {
  if (setsPoint) {
    setPoint(place, true);
    waitForPoint(false);
  }
}

function waitForPoint(waits) {
  setsPoint = waits;
  element("point").setAttribute("aria-pressed", String(waits));
  element("point").textContent = waits ? "Tap the map" : "Set point";
}

function setPoint(place, chosen) {
  point = place;
  map.setPoint(place);
  if (chosen) store("point", place);
}

function showTab(shown) {
  for (const tab of TABS) {
    element(tab).hidden = tab !== shown;
    element(`tab-${tab}`).setAttribute("aria-selected", String(tab === shown));
  }
  showLists();
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
}

function stored(key) {
  try {
    return JSON.parse(localStorage.getItem(key));
  } catch {
    return null;
  }
}

function store(key, value) {
  try {
    localStorage.setItem(key, JSON.stringify(value));
  } catch { /* a private window: it lasts until the page is closed */ }
}
