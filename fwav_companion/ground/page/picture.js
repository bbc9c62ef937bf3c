// What the server has sent: vehicles, targets, texts and paths, and how old they are.
const MAX_TEXTS = 200;
const MAX_PATH = 600;
const PATH_STEP_DEG = 5e-6;
// What a target in a local world has no value for.
const NOWHERE = { lat: null, lon: null, alt_amsl: null, contradicted: "", contradicted_unix: null, bound: false,
  source: "fleet", vehicles: {}, left_out: {} };

export class Picture {
  constructor() {
    this.vehicles = new Map();
    this.targets = new Map();
    this.texts = [];
    this.sources = [];
    this.localIds = new Map();
    this.paths = new Map();
    this.revision = 0;
    this.serverAhead = 0;
    this.changedTargets = new Set();
    this.changedVehicles = new Set();
    this.removedTargets = new Set();
  }

  // The time of the picture: the server's clock, or that of the recording.
  now() {
    return performance.now() / 1000 + this.serverAhead;
  }

  takePaths(paths) {
    this.paths = new Map(Object.entries(paths).map(([id, points]) => [id, points.map((at) => [at[1], at[2]])]));
  }

  takeUpdate(update) {
    this.serverAhead = update.now_unix - performance.now() / 1000;
    this.revision = update.revision;
    if (update.whole) this.forgetMissing(update);
    for (const vehicle of update.vehicles) {
      this.vehicles.set(vehicle.id, vehicle);
      this.changedVehicles.add(vehicle.id);
      this.extendPath(vehicle);
      this.takeLocal(vehicle);
    }
    for (const target of update.targets) {
      this.targets.set(target.id, target);
      this.changedTargets.add(target.id);
      this.removedTargets.delete(target.id);
    }
    for (const id of update.removed) this.remove(id);
    this.texts.push(...update.texts);
    this.texts.splice(0, Math.max(0, this.texts.length - MAX_TEXTS));
    this.sources = update.sources;
  }

  // Targets in a vehicle's local world come with the vehicle, all of them each time.
  takeLocal(vehicle) {
    const ids = new Set(vehicle.local_targets.map((target) => target.id));
    for (const id of this.localIds.get(vehicle.id) ?? []) if (!ids.has(id)) this.remove(id);
    for (const target of vehicle.local_targets) {
      this.targets.set(target.id, { ...NOWHERE, ...target, vehicle: vehicle.id });
      this.removedTargets.delete(target.id);
    }
    this.localIds.set(vehicle.id, ids);
  }

  localTargets(vehicle) {
    return [...this.localIds.get(vehicle) ?? []].map((id) => this.targets.get(id)).filter(Boolean);
  }

  // A removed target that came back later in the same update is among its targets.
  remove(id) {
    if (this.changedTargets.has(id) && this.targets.get(id)?.revision === this.revision) return;
    this.targets.delete(id);
    this.changedTargets.delete(id);
    this.removedTargets.add(id);
  }

  forgetMissing(update) {
    const kept = new Set(update.targets.map((target) => target.id));
    for (const id of [...this.targets.keys()]) if (!kept.has(id)) this.remove(id);
    const known = new Set(update.vehicles.map((vehicle) => vehicle.id));
    for (const id of [...this.vehicles.keys()]) if (!known.has(id)) {
      this.vehicles.delete(id);
      this.localIds.delete(id);
      this.changedVehicles.add(id);
    }
    this.texts = [];
  }

  extendPath(vehicle) {
    if (vehicle.lat === null) return;
    const path = this.paths.get(vehicle.id) ?? [];
    const last = path[path.length - 1];
    const step = last ? Math.hypot(vehicle.lat - last[0], vehicle.lon - last[1]) : Infinity;
    if (step < PATH_STEP_DEG) return;
    path.push([vehicle.lat, vehicle.lon]);
    if (path.length > MAX_PATH) path.shift();
    this.paths.set(vehicle.id, path);
  }

  // The ids that changed since the last call.
  takeChanges() {
    const changes = {
      targets: [...this.changedTargets], vehicles: [...this.changedVehicles], removed: [...this.removedTargets],
    };
    this.changedTargets.clear();
    this.changedVehicles.clear();
    this.removedTargets.clear();
    return changes;
  }
}
