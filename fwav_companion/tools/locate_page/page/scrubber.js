// The time in a video: a frame is asked for when the slider rests.
const REST_MS = 150;

export class Scrubber {
  constructor(element, { onFrame }) {
    this.slider = element.querySelector("#time");
    this.at = element.querySelector("#at");
    this.element = element;
    this.onFrame = onFrame;
    this.slider.addEventListener("input", () => this.rest());
    element.querySelector("#back").addEventListener("click", () => this.step(-1));
    element.querySelector("#forward").addEventListener("click", () => this.step(1));
  }

  open(seconds, name) {
    this.element.hidden = false;
    this.slider.max = seconds;
    this.name = name;
  }

  show(file) {
    const seconds = Number(file.slice(file.lastIndexOf("@") + 1));
    this.slider.value = seconds;
    this.at.textContent = clock(seconds);
  }

  step(seconds) {
    this.slider.value = Number(this.slider.value) + seconds;
    this.rest();
  }

  rest() {
    this.at.textContent = clock(Number(this.slider.value));
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.onFrame(`${this.name}@${Number(this.slider.value).toFixed(3)}`), REST_MS);
  }
}

function clock(seconds) {
  const whole = Math.floor(seconds / 60);
  return `${String(whole).padStart(2, "0")}:${(seconds - 60 * whole).toFixed(2).padStart(5, "0")}`;
}
