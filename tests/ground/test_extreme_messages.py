"""Extreme values within a fleet's schema, wrong first places, and faults of the fusion: the picture goes on."""

from __future__ import annotations

import csv
import json
import random
import xml.etree.ElementTree as ET
from io import StringIO

import msgspec
import numpy as np
import pytest
from fleet_messages import NOW, shared, tracks_message

from fwav_companion.fleet.payloads import encoded
from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.ground.exports import cot_events, csv_table, geojson, kml, one_document
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.fusion import fleet_fusion
from fwav_companion.ground.picture import GroundPicture

COVS = ((0,) * 6, (1e-300, 0, 0, 1e-300, 0, 1e-300), (9.9e7, 9.9e7, 0, 9.9e7, 0, 9.9e7), (9.9e7, 0, 0, 0, 0, 0),
        (1, 0.99, 0, 1, 0, 1))  # fmt: skip
NAMES = (("position_north", "position_east", "position_down", "heading"), (), ("heading",) * 16, ("position_north",))
STRANGE = ("a", "\u202e", "\x00\x1b[31m", "b" * 64)


def extreme(draw: random.Random, vehicle: str, seq: int, now: float) -> bytes:
    """A message of tracks at the ends of the schema's ranges."""
    pick = draw.choice
    names = pick(NAMES)
    sigmas = [pick((0, 1e-300, 0.1, 1, 1e4)) for _ in names]
    lat, lon = pick((0, 47, 90, -90)), pick((0, 180, -180, 8))

    def derivative(sigma: float) -> float:
        value = pick((0.0, 1.0, -1.0, 1e6, -1e6, 1e-300, 100.0))
        return value if abs(value) * sigma <= 1e4 else 0.0

    tracks = [
        {
            "track": pick((number, 2**53)), "label": pick(STRANGE), "state": pick(("confirmed", "tentative", "")),
            "lat": max(-90.0, min(90.0, lat + pick((0.0, 1e-5, -1e-12)))), "lon": lon,
            "alt_amsl": pick((None, 0, -1e4, 1e5)), "cov": pick(COVS), "cov_shared": pick(COVS),
            "bias_jacobian": [[derivative(sigma) for sigma in sigmas] for _ in range(3)],
            "vel": pick((None, (1e4, -1e4, 0))), "last_seen_s": pick((0, 1e9, -1e9, 3)),
        }
        for number in range(pick((1, 4, 20)))
    ]  # fmt: skip
    bias = {"names": names, "sigma": sigmas, "time_constant_s": pick((0, 1e9))}
    head = {"vehicle": vehicle, "time_unix": pick((now, 0, 1e11)), "seq": seq, "session": "s"}
    return json.dumps({**head, "bias": bias, "tracks": tracks}).encode()


def step(fused: FleetPicture, now: float) -> None:
    fused.step(now)
    while fused.is_stepping:
        fused.step(now)


@pytest.mark.parametrize("seed", range(4))
def test_extreme_values_within_the_schema_leave_the_picture_and_its_exports_sound(seed: int):
    draw, now = random.Random(seed), NOW
    picture = GroundPicture()
    fused = FleetPicture(picture)
    for seq in range(8):
        for vehicle in ("a", "b", "<img>", "\x00\x01"):
            fused.on_message(vehicle, "tracks", extreme(draw, vehicle, seq, now), now)
            ages = {"position_age_s": draw.choice((None, 1e9)), "alt_amsl": draw.choice((-1e4, 1e5))}
            state = {"vehicle": vehicle, "time_unix": now, "session": "s", "lat": 90, "lon": -180, **ages}
            fused.on_message(vehicle, "state", json.dumps({**state, "trouble": "\x00<b>"}).encode(), now)
        step(fused, now)
        picture.advance(now)
        targets, vehicles = picture.targets.values(), picture.vehicles.values()
        assert msgspec.json.decode(msgspec.json.encode(picture.update_since(0, now)))
        ET.fromstring(kml(targets, vehicles))
        json.loads(geojson(targets, vehicles))
        assert len(list(csv.reader(StringIO(csv_table(targets).decode())))) == len(targets) + 1
        events = cot_events(targets, 10**18, "", vehicles=vehicles, geoid=geoid_undulation_m, now_unix=now)
        ET.fromstring(one_document(events))
        assert all(-90.0 <= each.lat <= 90.0 and (each.radius95_m or 0.0) >= 0.0 for each in targets)
        now += 0.5
    assert "malformed" not in fused._intake.refused, "what was tried is within the schema"


def take(fused: FleetPicture, vehicle: str, place: tuple[float, float], seq: int, now: float) -> None:
    message = tracks_message(shared(lat=place[0], lon=place[1]), vehicle=vehicle, seq=seq, time_unix=now)
    fused.on_message(vehicle, "tracks", encoded(message)[0], now)


def test_a_wrong_first_place_is_reported_and_yields_to_two_vehicles_that_agree():
    picture = GroundPicture()
    fused = FleetPicture(picture)
    for seq in range(1, 9):
        now = NOW + seq * 0.5
        take(fused, "lost", (0.0, 0.0), seq, now)
        take(fused, "a", (48.0, 11.0), seq, now)
        if seq > 4:
            take(fused, "b", (48.0, 11.0), seq, now)
        step(fused, now)
    seen = [vehicle for target in picture.targets.values() for vehicle in target.vehicles]
    assert sorted(seen) == ["a", "b"]
    said = [(text.vehicle, text.text) for text in picture.update_since(0, now).texts if "left out" in text.text]
    assert [vehicle for vehicle, _ in said] == ["a", "lost"], "each once"
    assert "200 km" in said[0][1]


def test_a_vehicle_that_gets_its_position_late_moves_the_plane_with_it():
    picture = GroundPicture()
    fused = FleetPicture(picture)
    for seq in range(1, 5):
        take(fused, "a", (0.0, 0.0) if seq < 3 else (48.0, 11.0), seq, NOW + seq * 0.5)
        step(fused, NOW + seq * 0.5)
    (target,) = picture.targets.values()
    assert (target.lat, target.lon) == pytest.approx((48.0, 11.0))


def test_a_fault_of_the_fusion_is_raised_once_and_the_next_step_starts_anew(monkeypatch: pytest.MonkeyPatch):
    picture = GroundPicture()
    fused = FleetPicture(picture)
    take(fused, "a", (48.0, 11.0), 1, NOW)
    with monkeypatch.context() as broken:
        broken.setattr(fleet_fusion, "solution_slices", lambda *_, **__: np.linalg.inv(np.zeros((2, 2))))
        with pytest.raises(np.linalg.LinAlgError):
            step(fused, NOW)
    take(fused, "a", (48.0, 11.0), 2, NOW + 1.0)
    step(fused, NOW + 1.0)
    assert len(picture.targets) == 1
