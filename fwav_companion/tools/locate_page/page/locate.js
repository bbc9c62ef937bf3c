// Joins the parts: a click in a picture goes to the program, whose answer is drawn in pictures, map and list.
import { PictureView } from "./picture_view.js";
import { PlaceMap } from "./place_map.js";
import { Scrubber } from "./scrubber.js";
import { TargetList } from "./target_list.js";

const COLOURS = ["#ff7a1a", "#2f8fff", "#16a34a", "#d946ef", "#eab308", "#ef4444", "#06b6d4", "#8b5cf6"];
const element = (id) => document.getElementById(id);

let pictures = [];
let state = { clicks: [], answers: { targets: [], shared: [], assumed: [], contradiction: "", unverified: "" }, without_place: [] };
let shown = null;
let current = "target 1";
let asked = 0;
let settings = null;

setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
const view = new PictureView(element("picture"), { onClick: click });
const map = new PlaceMap(element("map"), { onPicture: show, onTarget: choose });
const list = new TargetList(element("targets"), { onTarget: choose });
const scrubber = new Scrubber(element("scrubber"), { onFrame: show });
window.locatePage = { view, map, state: () => state, shown: () => shown, show, click };

element("fit").addEventListener("click", () => map.fit());
element("next").addEventListener("click", () => choose(freeLabel()));
element("remove").addEventListener("click", () => change("remove", { label: current, file: shown }));
element("label").addEventListener("change", rename);
element("theme").addEventListener("click", () => {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  map.graticule.draw();
  draw();
});
document.addEventListener("keydown", (event) => {
  if (event.target.matches("input")) return;
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  const next = pictures[pictures.findIndex((each) => each.file === shown) + step];
  if (step && next && !event.target.closest(".leaflet-container")) show(next.file);
});
open().catch((error) => warn(String(error)));

async function open() {
  settings = await (await fetch("settings.json")).json();
  pictures = await (await fetch("pictures.json")).json();
  list.reasons = settings.reasons;
  element("from").textContent = `fwav-companion ${settings.version}.`;
  element("saved").textContent = "opened";
  if (settings.tiles) map.addTiles(settings.tiles);
  if (settings.video_s !== null) {
    scrubber.open(settings.video_s, pictures[0].file.slice(0, pictures[0].file.lastIndexOf("@")));
  }
  take(await (await fetch("state.json")).json());
  current = state.clicks.at(-1)?.label ?? current;
  show(state.clicks.at(-1)?.file ?? pictures[0].file);
  map.fit();
}

async function show(file) {
  const known = pictures.find((each) => each.file === file);
  shown = file;
  if (settings.video_s !== null) scrubber.show(file);
  view.show(known ?? { ...pictures[0], file });
  draw();
  document.querySelector("#strip [aria-selected=true]")?.scrollIntoView({ block: "nearest", inline: "nearest" });
  if (!known) await ask(`state.json?show=${encodeURIComponent(file)}`);
}

function click(u, v) {
  return change("click", { file: shown, u, v, label: current });
}

async function change(what, body) {
  element("saved").textContent = "saving";
  const options = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  if (!await ask(what, options)) return false;
  element("saved").textContent = `saved in ${settings.clicks.split(/[/\\]/).pop()}`;
  element("saved").title = settings.clicks;
  if (settings.video_s !== null && !pictures.some((each) => each.file === shown)) {
    pictures = await (await fetch("pictures.json")).json();
    draw();
  }
  return true;
}

// Answers of older requests are dropped: the newest has all clicks.
async function ask(path, options) {
  const number = ++asked;
  try {
    const answer = await fetch(path, options);
    if (!answer.ok) throw new Error((await answer.text()).trim());
    const next = await answer.json();
    if (number === asked) take(next);
    return true;
  } catch (error) {
    element("saved").textContent = "not saved";
    warn(error instanceof TypeError ? "No connection to the program: this click is not saved." : error.message);
    return false;
  }
}

function take(next) {
  state = next;
  warn(state.answers.contradiction ? `${state.answers.contradiction}.` : "");
  draw();
}

function draw() {
  view.draw(state, current, colourOf);
  map.drawPictures(pictures, shown);
  map.drawPlaces(state, current, colourOf);
  list.show(state, current, colourOf);
  drawStrip();
  if (document.activeElement !== element("label")) element("label").value = current;
  element("remove").disabled = !state.clicks.some((each) => each.label === current && each.file === shown);
  const notes = [state.answers.unverified, ...state.answers.assumed].filter(Boolean);
  element("assumed").replaceChildren(...notes.map((note) => {
    const item = document.createElement("li");
    item.textContent = note;
    return item;
  }));
}

function drawStrip() {
  const strip = element("strip");
  const known = new Map([...strip.children].map((each) => [each.dataset.file, each]));
  const buttons = pictures.map((picture) => {
    const button = known.get(picture.file) ?? thumbnail(picture.file);
    const count = state.clicks.filter((each) => each.file === picture.file).length;
    button.querySelector(".count").textContent = count;
    button.querySelector(".count").hidden = !count;
    button.setAttribute("aria-selected", String(picture.file === shown));
    return button;
  });
  if (buttons.length !== strip.children.length || buttons.some((each, i) => strip.children[i] !== each)) {
    strip.replaceChildren(...buttons);
  }
}

function thumbnail(file) {
  const button = document.createElement("button");
  button.type = "button";
  button.dataset.file = file;
  button.setAttribute("role", "option");
  const image = document.createElement("img");
  image.loading = "lazy";
  image.alt = "";
  image.src = `small/${encodeURIComponent(file)}`;
  const name = document.createElement("span");
  name.textContent = file.includes("@") ? `${file.slice(file.lastIndexOf("@") + 1)} s` : file;
  const count = document.createElement("span");
  count.className = "count";
  button.append(image, name, count);
  button.addEventListener("click", () => show(file));
  return button;
}

async function rename() {
  const wanted = element("label").value.trim();
  const exists = (label) => state.clicks.some((each) => each.label === label);
  element("label").blur();
  if (!wanted || wanted === current) return draw();
  if (exists(wanted) || !exists(current)) return choose(wanted);
  const old = current;
  current = wanted;
  if (!await change("rename", { label: old, new: wanted })) current = old;
  return draw();
}

function choose(label) {
  current = label;
  draw();
}

function freeLabel() {
  const used = new Set(state.clicks.map((each) => each.label));
  let number = 1;
  while (used.has(`target ${number}`)) number += 1;
  return `target ${number}`;
}

function colourOf(label) {
  const labels = [...new Set(state.clicks.map((each) => each.label))];
  return COLOURS[Math.max(0, labels.indexOf(label)) % COLOURS.length];
}

function warn(message) {
  element("warning").hidden = !message;
  element("warning").textContent = message;
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
}
