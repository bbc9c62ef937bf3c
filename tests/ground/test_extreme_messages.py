"""Extreme values within a fleet's schema, wrong first places, and faults of the fusion: the picture goes on."""

from __future__ import annotations

import asyncio
import csv
import json
import random
import xml.etree.ElementTree as ET
from io import StringIO

import msgspec
import numpy as np
import pytest
from fleet_messages import NOW, shared, tracks_message
from picture_receiver import NOW as FLOWN
from picture_receiver import Receiver, heartbeat, position, text

from fwav_companion.cli.ground_inputs import findings_by_status
from fwav_companion.fleet.payloads import encoded
from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.ground import status_reader
from fwav_companion.ground.exports import cot_events, csv_table, geojson, kml, one_document
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.fusion import fleet_fusion
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.status_reader import StatusReader
from fwav_companion.tools.doctor.run_status import run_status

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


def exports_of(picture: GroundPicture, now: float) -> list[bytes]:
    """Every export, and the page's update."""
    targets, vehicles = picture.targets.values(), picture.vehicles.values()
    events = cot_events(targets, 10**18, "", vehicles=vehicles, geoid=geoid_undulation_m, now_unix=now)
    return [
        kml(targets, vehicles), geojson(targets, vehicles), csv_table(targets), one_document(events),
        msgspec.json.encode(picture.update_since(0, now)),
    ]  # fmt: skip


@pytest.mark.parametrize("place", ["9.0, 181.0", "91.0, 8.0", f"{'9' * 400}.0, 8.0"])
def test_a_text_with_a_place_beyond_the_earth_makes_no_target_and_is_reported(place: str):
    receiver = Receiver()
    receiver.take(1, heartbeat())
    wide = "found person 4: 48.0, 11.0, 95 % within 1" + 99 * "0" + " m"
    for said in (f"found person 3: {place}, 95 % within 2 m", wide):
        receiver._targets._on_text(1, 191, 5, text=said, now=FLOWN)
    assert list(receiver.picture.targets) == ["1/4"]
    assert receiver.picture.targets["1/4"].radius95_m is None, "such a circle shows nothing"
    assert any(
        "its position is none on the earth" in each.text for each in receiver.picture.update_since(0, FLOWN).texts
    )
    assert all(exports_of(receiver.picture, FLOWN))


def test_a_vehicle_at_an_impossible_place_stays_where_it_was_and_its_place_grows_old():
    receiver = Receiver()
    receiver.take(1, heartbeat())
    receiver.take(1, position(48.0, 11.0), now=FLOWN)
    receiver.flush(FLOWN)
    receiver.take(1, position(214.0, 11.0), now=FLOWN + 9.0)
    receiver.flush(FLOWN + 9.0)
    shown = receiver.picture.vehicles["1"]
    assert (shown.lat, shown.lon, shown.heard["position"]) == (48.0, 11.0, FLOWN)
    assert all(exports_of(receiver.picture, FLOWN + 9.0))


def test_chunks_of_a_text_that_is_too_long_are_left_out():
    receiver = Receiver()
    receiver.take(1, heartbeat())
    receiver.take(1, text(b"x" * 50, number=7, sequence=200))
    receiver.flush(FLOWN + 60.0)
    assert [each.text for each in receiver.picture.update_since(0, FLOWN).texts if "x" in each.text] == []


IMPOSSIBLE = {
    "future": {"autopilot": {"system": 1, "age_s": -1e9}, "intake": {"came": 1, "age_s": -1e300}},
    "place": {"tracks": [{"track": 1, "lat": 1e300, "lon": 0.0}]},
    "ages": {"tracks": [{"track": 1, "lat": 1.0, "lon": 2.0, "last_seen_s": 1e300, "first_seen_s": -1e300}]},
    "claim": {"tracks": [{"track": 1, "lat": 1.0, "lon": 2.0, "cov": [1e300, 0, 0, 1e300, 0, 1e300]}]},
    "label": {"tracks": [{"track": 1, "lat": 1.0, "lon": 2.0, "label": "\x00" * 9999}], "obstacle": "\x1b" * 9999},
    "altitude": {"tracks": [{"track": 1, "lat": 1.0, "lon": 2.0, "alt_amsl": 1e308}]},
    "path": {"config_path": "a\x00b"},
}


@pytest.mark.parametrize("kind", IMPOSSIBLE)
def test_impossible_values_in_a_status_leave_the_picture_and_its_exports_sound(kind: str):
    picture = GroundPicture()
    status = run_status({"autopilot": {"system": 1, "age_s": 0.1}, "time_monotonic": 5.0, **IMPOSSIBLE[kind]})
    reader = StatusReader("f", picture, clock=lambda: FLOWN, understand=lambda _: None, judge=findings_by_status)
    asyncio.run(reader._take(status))
    picture.advance(FLOWN + 9.0)
    vehicle = picture.vehicles["1"]
    assert vehicle.silent, "a stamp in the future is not news for ever"
    assert len(vehicle.readiness or "") <= 300
    assert all(abs(each.lat) <= 90.0 and FLOWN - 1e9 <= each.seen_unix <= FLOWN for each in picture.targets.values())
    assert all(exports_of(picture, FLOWN))


def test_a_fault_with_one_status_is_reported_and_the_next_one_is_read(tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(status_reader, "PERIOD_S", 0.01)
    path, picture, faults = tmp_path / "status.json", GroundPicture(), []
    path.write_text('{"autopilot": {"system": 1}, "time_monotonic": 5.0}')

    def judge(_status):
        if not faults:
            path.write_text('{"autopilot": {"system": 1}, "time_monotonic": 6.0}')
            raise KeyError("ours")
        return ("WARNING: slow",)

    async def read() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: faults.append(context["exception"]))
        clock = lambda: FLOWN + 20.0 * len(faults)  # noqa: E731
        reader = StatusReader(str(path), picture, clock=clock, understand=run_status, judge=judge)
        reader.start()
        async with asyncio.timeout(30.0):
            while not picture.vehicles:  # noqa: ASYNC110  # the picture has no event
                await asyncio.sleep(0.01)
        reader.close()

    asyncio.run(read())
    assert [type(each) for each in faults] == [KeyError]
    assert picture.vehicles["1"].checks == ("WARNING: slow",)
