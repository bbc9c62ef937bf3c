"""The process that flies one flight after the other, and flights that differ in one cause alone."""

import io
import json
import math

import pytest

from sitl_mock import simulate
from sitl_mock.camera import FrameTruth
from sitl_mock.options import Options
from sitl_mock.recording import record
from sitl_mock.scenarios import scenario
from sitl_mock.service import serve


def replies(*requests):
    """(reply, its files) of each request."""
    out = io.BytesIO()
    serve(io.BytesIO(b"".join(json.dumps(request).encode() + b"\n" for request in requests)), out)
    out.seek(0)
    found = []
    for _ in requests:
        reply = json.loads(out.readline())
        found.append((reply, [out.read(reply.get(name, 0)) for name in ("telemetry", "detections", "truth_csv")]))
    assert out.read() == b""
    return found


def test_a_flight_has_the_bytes_of_a_recording(tmp_path):
    options = scenario("default").but({"seconds": 4.0, "seed": 5})
    record(options, tmp_path)
    ((reply, files),) = replies({"scenario": "default", "set": {"seconds": 4.0, "seed": 5}})
    for name, data in zip(("telemetry.tlog", "detections.jsonl", "truth.csv"), files, strict=True):
        assert (tmp_path / name).read_bytes() == data
    frames = (tmp_path / "detections.jsonl").read_text().splitlines()
    assert reply["format"] == 1
    assert len(frames) <= reply["frames"] <= len(frames) + 3  # the newest are on their way at the end
    assert 0 < reply["in_view"] <= reply["frames"]


def test_flights_do_not_depend_on_those_before_them():
    request = {"set": {"seconds": 2.0, "seed": 3, "targets": [{"label": "pad", "north": 1.5}]}}
    first, _, again = replies(request, {"set": {"seconds": 1.0}}, request)
    assert first == again
    assert b'"pad"' in first[1][1]


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"set": {"flight.heigth_m": 3.0}}, "is it 'height_m'?"),
        ({"set": {"flight.height_m": "high"}}, "expected"),
        ({"set": {"targets": [{"labl": "x"}], "seconds": -1.0}}, "expected"),
        ({"scenario": "none"}, "no scenario 'none'"),
        ([], "get"),
    ],
)
def test_what_cannot_be_flown_is_an_error_and_the_next_flight_flies(request_, said):
    (wrong, _), (right, _) = replies(request_, {"set": {"seconds": 1.0}})
    assert said in wrong["error"]
    assert "error" not in right


def detections(**differences):
    """The detections of each frame, with the truth about them."""
    options = Options().but({"seconds": 6.0, "noise_by_cause": True, "camera.clutter": 0.3, "camera.missed": 0.2})
    options = options.but({key.replace("__", "."): value for key, value in differences.items()})
    frames, truths = {}, {}
    for _, what in simulate(options):
        if isinstance(what, FrameTruth):
            truths[what.frame] = what
        elif isinstance(what, dict):
            frames[what["frame"]] = what["detections"]
    return frames, truths


def test_without_pixel_noise_all_other_draws_stay():
    (ours, our_truth), (theirs, their_truth) = detections(), detections(priors__pixel_noise_px=0.0)
    assert ours.keys() == theirs.keys()
    assert {k: t.sources for k, t in our_truth.items()} == {k: t.sources for k, t in their_truth.items()}
    for frame, found in ours.items():
        for one, other, source in zip(found, theirs[frame], our_truth[frame].sources, strict=True):
            assert (one["u"] == other["u"]) == (source < 0)


def test_a_target_out_of_view_leaves_later_draws_as_they_are():
    """A target that is far away is never seen; it draws as much as one in view."""
    far = ({"label": "target"}, {"label": "far", "north": 500.0})
    from sitl_mock.options import TargetOptions

    both = {"targets": tuple(TargetOptions(**each) for each in far), "camera__clutter": 0.0}
    near = {"targets": (TargetOptions(), TargetOptions(label="far", north=500.0)), "camera__clutter": 0.0}
    assert detections(**both) == detections(**near)
    missed = [not truth.sources for truth in detections(**both)[1].values()]
    assert 0.1 < sum(missed) / len(missed) < 0.3


def test_the_nose_points_along_the_velocity_through_the_air():
    wind = (1.5, -2.0)
    flight = simulate(scenario("figure_eight").but({"flight.wind_m_s": wind, "flight.wander_deg": 0.0,
                                                    "flight.wander_m": 0.0, "flight.heave_m": 0.0})).flight  # fmt: skip
    for t in (0.0, 3.3, 7.9, 12.1):
        state = flight.at(t)
        north, east = state.velocity[0] - wind[0], state.velocity[1] - wind[1]
        off = (state.euler[2] - math.atan2(east, north) + math.pi) % (2.0 * math.pi) - math.pi
        assert abs(off) < 1e-9


def test_a_drifting_pattern_moves_as_its_velocity_says():
    flight = simulate(scenario("racetrack").but({"flight.drift_m_s": (0.5, -1.0)})).flight
    still = simulate(scenario("racetrack")).flight
    h = 1e-5
    for t in (1.0, 20.0):
        there, here = flight.at(t).position, still.at(t).position
        assert (there[0] - here[0], there[1] - here[1]) == pytest.approx((0.5 * t, -1.0 * t))
        moved = [(b - a) / (2.0 * h) for a, b in zip(flight.at(t - h).position, flight.at(t + h).position, strict=True)]
        assert moved == pytest.approx(flight.at(t).velocity, abs=1e-5)
