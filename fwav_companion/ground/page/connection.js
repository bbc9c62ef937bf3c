// Server-Sent Events with a watch: an open connection that brings nothing counts as lost.
const SILENT_MS = 4000;
const RETRY_MS = 1500;

export class Connection {
  constructor({ onPaths, onPicture, onState }) {
    this.handlers = { onPaths, onPicture };
    this.onState = onState;
    this.heardMs = performance.now();
    this.lostMs = null;
    this.open();
    setInterval(() => this.watch(), 500);
  }

  open() {
    this.source = new EventSource("events");
    this.openedMs = performance.now();
    this.source.addEventListener("paths", (event) => this.handlers.onPaths(JSON.parse(event.data)));
    this.source.addEventListener("picture", (event) => {
      this.heardMs = performance.now();
      this.lostMs = null;
      this.handlers.onPicture(JSON.parse(event.data));
      this.onState("live", 0);
    });
  }

  // A browser gives up by itself after some answers, and never notices a dead network: open again.
  watch() {
    const silent = performance.now() - this.heardMs;
    if (silent < SILENT_MS) return;
    this.lostMs ??= this.heardMs;
    this.onState("lost", (performance.now() - this.lostMs) / 1000);
    if (performance.now() - this.openedMs > SILENT_MS + RETRY_MS) {
      this.source.close();
      this.open();
    }
  }
}
