"""A fleet's messages as bytes to the picture, and back to the bus."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from math import hypot
from pathlib import Path

import msgspec
import numpy as np
import pytest
from simulated_fleet import START, STEP_S, FleetOptions, SimulatedFleet, SimulatedVehicle

from fwav_companion.fleet.payloads import SharedTrack, StateMessage, TracksMessage, VehicleBias, encoded
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.picture import GroundPicture

PLANE = TangentPlane(Geodetic.from_degrees(48.1372, 11.5756, 519.0))


def full(cov: np.ndarray) -> tuple[float, ...]:
    return tuple(float(f"{value:.3g}") for value in (cov[0, 0], cov[0, 1], 0.0, cov[1, 1], 0.0, 1.0))


def as_message(fleet: SimulatedFleet, vehicle: SimulatedVehicle, seq: int, **changes) -> bytes:
    """The reports of a simulated vehicle as it would publish them."""
    reports, sigmas = fleet.reports(vehicle)
    tracks = []
    for report in reports:
        place = PLANE.geodetic_from_ned((*report.position, 0.0))
        own = report.jacobian @ np.diag(sigmas**2) @ report.jacobian.T
        rows = np.zeros((3, 4))
        rows[:2, (0, 1, 3)] = report.jacobian
        tracks.append(
            SharedTrack(
                track=report.track, label=report.label, state="confirmed", lat=place.lat_deg, lon=place.lon_deg,
                alt_amsl=519.0, cov=full(report.noise + report.shared + own), cov_shared=full(report.shared),
                bias_jacobian=tuple(map(tuple, rows.tolist())),
            )
        )  # fmt: skip
    north, east, heading = sigmas.tolist()
    bias = VehicleBias(sigma=(north, east, 0.5, heading))
    fields = {"vehicle": vehicle.name, "time_unix": fleet.now, "seq": seq, "session": "a", "bias": bias}
    (data,) = encoded(TracksMessage(tracks=tuple(tracks), **{**fields, **changes}))
    return data


def flown(options: FleetOptions, seconds: float) -> tuple[SimulatedFleet, GroundPicture, list[bytes], float]:
    """Fleet, picture, the last fused message, and the CPU seconds that the ground process's part took."""
    fleet, picture = SimulatedFleet(options, 2), GroundPicture()
    fused, last, spent = FleetPicture(picture), [], 0.0
    for seq in range(1, round(seconds / STEP_S) + 1):
        messages = [(vehicle.name, as_message(fleet, vehicle, seq)) for vehicle in fleet.vehicles]
        before = time.process_time()
        for name, data in messages:
            fused.on_message(name, "tracks", data, fleet.now)
        last = fused.step(fleet.now) or last
        picture.advance(fleet.now)
        spent += time.process_time() - before
        fleet.seconds += STEP_S
    return fleet, picture, last, spent


def test_three_vehicles_messages_become_one_picture():
    fleet, picture, last, _ = flown(FleetOptions(), 10.0)
    assert len(picture.targets) == len(fleet.truth)
    for target in picture.targets.values():
        north, east, _ = PLANE.ned_from_geodetic(Geodetic.from_degrees(target.lat, target.lon, 519.0))
        distances = [hypot(north - place[0], east - place[1]) for place in fleet.truth]
        assert min(distances) < 3.0
        assert len(target.vehicles) == 3
        assert target.ellipse is not None
    (message,) = last
    content = json.loads(message)
    assert len(content["tracks"]) == len(fleet.truth)
    assert content["tracks"][0]["vehicles"].keys() == {"1", "2", "3"}
    assert content["tracks"][0]["left_out"] == {}


def test_targets_that_a_fused_one_stands_for_are_not_shown_twice():
    _, picture, _, _ = flown(FleetOptions(targets=3, seen_each=3), 3.0)
    (fused, *_) = picture.targets.values()
    vehicle, track = next(iter(fused.vehicles.items()))
    from fwav_companion.ground.views import TargetView

    picture.on_target(
        TargetView(id=f"{vehicle}/{track}", vehicle=vehicle, state="selected", lat=48.0, lon=11.0, first_unix=START,
                   seen_unix=START, source="mavlink"), START,
    )  # fmt: skip
    assert f"{vehicle}/{track}" not in picture.targets


def test_a_vehicle_with_a_wrong_clock_takes_part():
    fleet, picture = SimulatedFleet(FleetOptions(), 2), GroundPicture()
    fused = FleetPicture(picture)
    for seq in range(1, 12):
        for vehicle in fleet.vehicles:
            stamp = fleet.now - (3600.0 if vehicle.name == "2" else 0.0)
            fused.on_message(vehicle.name, "tracks", as_message(fleet, vehicle, seq, time_unix=stamp), fleet.now)
        fused.step(fleet.now)
        fleet.seconds += STEP_S
    assert all("2" in target.vehicles for target in picture.targets.values())
    assert any("clock is off" in text.text for text in picture.update_since(0, START).texts)


def test_a_network_that_is_cut_for_a_minute_is_reported_once_and_every_target_comes_back_once():
    """Two of three vehicles are cut off; what they sent in that minute is lost."""
    fleet, picture = SimulatedFleet(FleetOptions(targets=6, seen_each=6), 3), GroundPicture()
    fused, texts = FleetPicture(picture), []
    cut, back = range(round(15.0 / STEP_S), round(75.0 / STEP_S)), round(75.0 / STEP_S)
    for seq in range(1, back + round(20.0 / STEP_S)):
        for vehicle in fleet.vehicles:
            is_cut = seq in cut and vehicle.name != "1"
            if vehicle.name != "1" and seq in (cut.start, back):
                fused.on_alive(vehicle.name, not is_cut, fleet.now)
            data = as_message(fleet, vehicle, seq)
            if not is_cut:
                fused.on_message(vehicle.name, "tracks", data, fleet.now)
                fused.on_message(vehicle.name, "state", state_message(vehicle.name, fleet.now), fleet.now)
        fused.step(fleet.now)
        picture.advance(fleet.now)
        texts = [(text.vehicle, text.text) for text in picture.update_since(0, START).texts]
        if seq == cut.stop - 1:  # the vehicle that remains goes on alone
            assert len(picture.targets) == len(fleet.truth)
            assert all(target.vehicles.keys() == {"1"} for target in picture.targets.values())
        fleet.seconds += STEP_S
    assert len(picture.targets) == len(fleet.truth)
    assert all(target.vehicles.keys() == {"1", "2", "3"} for target in picture.targets.values())
    assert sorted(vehicle for vehicle, text in texts if "left the fleet" in text) == ["2", "3"]
    assert sorted(vehicle for vehicle, text in texts if text.startswith("silent")) == ["2", "3"]


def state_message(vehicle: str, now: float, session: str = "a") -> bytes:
    return msgspec.json.encode(StateMessage(vehicle=vehicle, time_unix=now, session=session, lat=48.0, lon=11.0))


def test_two_vehicles_with_one_name_are_reported_and_shown_as_the_first():
    fleet, picture = SimulatedFleet(FleetOptions(vehicles=2, targets=3, seen_each=3), 2), GroundPicture()
    fused = FleetPicture(picture)
    for seq in range(1, 12):
        for vehicle, session in zip(fleet.vehicles, "ab", strict=True):
            data = as_message(fleet, vehicle, seq, session=session)
            fused.on_message("1", "tracks", data, fleet.now)
        fused.step(fleet.now)
        fleet.seconds += STEP_S
    assert len(picture.targets) == len(fleet.truth)
    texts = [text.text for text in picture.update_since(0, START).texts]
    assert sum("two senders have this name" in text for text in texts) == 1, texts


def test_malformed_messages_change_nothing_and_are_reported():
    picture = GroundPicture()
    fused = FleetPicture(picture)
    for data in (b"", b"{", b"x" * 70_000, b'{"vehicle": 1}'):
        fused.on_message("9", "tracks", data, START)
        fused.on_message("9", "state", data, START)
    fused.step(START)
    assert not picture.targets
    assert not picture.vehicles
    assert picture.update_since(0, START).texts


MEASURED = """
import sys
sys.path[:0] = {path!r}
from peak_memory import peak_kb
from test_fleet_picture import flown
from simulated_fleet import FleetOptions
_, _, _, spent = flown(FleetOptions(vehicles=100, targets=100, extent_m=300.0), 20.0)
print(spent / 20.0, peak_kb() / 1024)
"""


@pytest.mark.slow
def test_a_hundred_vehicles_cost_less_than_half_a_core_and_300_mib(capsys):
    """Decoding, fusing and showing 100 vehicles with 10 targets each at 2 Hz, in a process of its own."""
    script = MEASURED.format(path=[str(Path(__file__).parent), *sys.path])
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=280)
    share, mib = map(float, done.stdout.split())
    with capsys.disabled():
        print(f"\n100 vehicles: {share:.3f} of a core, {mib:.0f} MiB with the simulation")
    assert share < 0.5
    assert mib < 300.0
