"""The wire format of detections: accepted lines, refused lines with the reason, and that no bytes break it."""

import json
import math
import random

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import Detection, Frame, NoFrame, Reason, StampClock
from fwav_companion.vision.wall_clock import RecordingClock, WallClock
from fwav_companion.vision.wire import MOST_FRAME_BYTES, encode_frame, parse_frame

ARRIVAL = HostNs(500_000_000_000)
"""The board is up for 500 s."""
UNIX_MINUS_HOST = 1_790_000_000_000_000_000
LIVE = WallClock(HostNs(0), UNIX_MINUS_HOST)
SEEN = {"u": 312.4, "v": 201.9}
STAMP = {"time_monotonic": 499.97}


def parsed(*, detections: object = (), **fields: object) -> Frame | NoFrame:
    return parse_frame(json.dumps({**fields, "detections": detections}).encode(), ARRIVAL, LIVE)


def frame_of(**fields: object) -> Frame:
    frame = parsed(**fields)
    assert isinstance(frame, Frame), frame
    return frame


def test_the_documented_example():
    text = """{"time_unix": 1790000001.250000, "frame": 37, "size": [640, 480], "exposure_s": 0.004,
     "detections": [{"u": 312.4, "v": 201.9, "sigma": 4.0, "label": "person", "score": 0.83, "box": [300.0, 150.0, 325.0, 202.0], "id": 7}]}"""  # noqa: E501
    assert parse_frame(text.encode(), ARRIVAL, LIVE) == Frame(
        number=37,
        stamp_ns=1_250_000_000,
        stamp_clock=StampClock.HOST,
        arrival_ns=ARRIVAL,
        detections=(Detection(312.4, 201.9, (4.0, 4.0), "person", 0.83, (300.0, 150.0, 325.0, 202.0), 7),),
        size=(640, 480),
        exposure_s=0.004,
    )


@pytest.mark.parametrize(
    ("fields", "stamp_ns", "clock"),
    [
        ({"time_unix": 1_790_000_499.9500004}, 499_950_000_000, StampClock.HOST),
        ({"time_monotonic": 499.9500004}, 499_950_000_000, StampClock.HOST),
        ({"time_monotonic": 0}, 0, StampClock.HOST),
        ({"time_boot": 123.4567891}, 123_456_789_000, StampClock.BOOT),
        ({"time_boot": 123.5, "time_unix": None}, 123_500_000_000, StampClock.BOOT),
    ],
)
def test_stamps_in_whole_microseconds(fields: dict[str, object], stamp_ns: int, clock: StampClock):
    frame = frame_of(**fields)
    assert (frame.stamp_ns, frame.stamp_clock) == (stamp_ns, clock)
    assert frame.detections == ()
    assert (frame.number, frame.size, frame.exposure_s) == (None, None, None)


@pytest.mark.parametrize(
    ("sigma", "expected"),
    [(4, (4.0, 4.0)), ([3, 5.5], (3.0, 5.5)), (None, None), (0, (0.0, 0.0)), (-1, (-1.0, -1.0))],
)
def test_sigma_one_or_two(sigma: object, expected: object):
    assert frame_of(**STAMP, detections=[{**SEEN, "sigma": sigma}]).detections[0].sigma == expected


def test_everything_else_is_optional_and_unknown_fields_are_ignored():
    detection = {**SEEN, "label": None, "score": None, "box": None, "id": None, "colour": [1, {"deep": "red"}]}
    frame = frame_of(**STAMP, detections=[detection], frame=None, size=None, exposure_s=None, weather={"rain": True})
    assert frame.detections == (Detection(312.4, 201.9),)


def test_a_line_of_megabytes_is_refused_before_it_is_decoded():
    assert parse_frame(b"9" * (MOST_FRAME_BYTES + 1), ARRIVAL, LIVE) == NoFrame(
        Reason.MALFORMED, f"{MOST_FRAME_BYTES + 1} bytes, accepted: {MOST_FRAME_BYTES}"
    )


def test_corners_of_a_marker():
    corners = [[1, 2], [3.5, 2], [3.5, 4], [1, 4]]
    frame = frame_of(**STAMP, detections=[{**SEEN, "corners": corners}, {**SEEN, "corners": None}])
    assert [d.corners for d in frame.detections] == [((1.0, 2.0), (3.5, 2.0), (3.5, 4.0), (1.0, 4.0)), None]


@pytest.mark.parametrize(
    "corners",
    [
        "[[1, 2], [3, 4], [5, 6]]",
        "[[1], [3, 4], [5, 6], [7, 8]]",
        "[1, 2, 3, 4, 5, 6, 7, 8]",
        '{"tl": [1, 2]}',
        '"four"',
        "4",
        "[[1, 2], [3, 4], [5, 6], [7, NaN]]",
        "[[1, 2], [3, 4], [5, 6], [7, 1e999]]",
    ],
)
def test_what_another_program_calls_corners_costs_no_detection(corners: str):
    line = f'{{"time_boot": 1, "detections": [{{"u": 312.4, "v": 201.9, "corners": {corners}}}]}}'
    frame = parse_frame(line.encode(), ARRIVAL, LIVE)
    assert isinstance(frame, Frame)
    assert frame.detections == (Detection(312.4, 201.9),)


REFUSED = [
    (b"", Reason.MALFORMED),
    (b"{", Reason.MALFORMED),
    (b"null", Reason.MALFORMED),
    (b"[]", Reason.MALFORMED),
    (b"\xff\x00{}", Reason.MALFORMED),
    (b'{"time_boot": 1}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": null}', Reason.MALFORMED),
    (b'{"time_boot": "1", "detections": []}', Reason.MALFORMED),
    (b'{"time_boot": true, "detections": []}', Reason.MALFORMED),
    (b'{"time_boot": -1, "detections": []}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": 1}]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": "1", "v": 1}]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "sigma": [1]}]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "label": 5}]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "label": "\\ud800"}]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "label": "' + b"x" * 257 + b'"}]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "id": ' + b"9" * 30 + b"}]}", Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [], "size": [0, 480]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [], "size": [640]}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [], "exposure_s": -0.001}', Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [], "x": ' + b"[" * 20_000, Reason.MALFORMED),
    (b'{"time_boot": 1, "detections": [], "x": ' + b"1" * 20_000, Reason.MALFORMED),
    (b'{"detections": []}', Reason.NO_TIME),
    (b'{"time_boot": 1, "time_unix": 1790000000, "detections": []}', Reason.NO_TIME),
    (b'{"time_boot": 1e999, "detections": []}', Reason.NOT_FINITE),
    (b'{"time_unix": NaN, "detections": []}', Reason.NOT_FINITE),
    (b'{"time_boot": 1, "detections": [], "exposure_s": Infinity}', Reason.NOT_FINITE),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "score": NaN}]}', Reason.NOT_FINITE),
    (b'{"time_boot": 1, "detections": [{"u": 1, "v": 1, "box": [0, 0, 1, NaN]}]}', Reason.NOT_FINITE),
    (b'{"time_unix": 1790000001250, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_unix": 1790000001250000, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_unix": 1790000001250000000, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_monotonic": 499970, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_monotonic": 499970000, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_monotonic": 499970000000, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_boot": 499970000000, "detections": []}', Reason.WRONG_UNITS),
    (b'{"time_boot": 1, "detections": [], "exposure_s": 4000}', Reason.WRONG_UNITS),
]


@pytest.mark.parametrize(("data", "reason"), REFUSED, ids=[f"{i} {reason}" for i, (_, reason) in enumerate(REFUSED)])
def test_what_is_refused_and_why(data: bytes, reason: Reason):
    refused = parse_frame(data, ARRIVAL, LIVE)
    assert isinstance(refused, NoFrame)
    assert refused.reason is reason, refused.detail


def test_a_stamp_that_is_only_late_or_early_is_in_no_other_unit():
    """Pairing judges it by its age; here its unit alone is in question."""
    for seconds in (0.0, 1.0, 499.0, 500.1, 503.0, 5_000.0):
        frame_of(time_monotonic=seconds)


def test_256_detections_and_one_more():
    assert len(frame_of(**STAMP, detections=[SEEN] * 256).detections) == 256
    refused = parsed(**STAMP, detections=[SEEN] * 257)
    assert isinstance(refused, NoFrame)
    assert refused.reason is Reason.TOO_MANY_DETECTIONS


@pytest.mark.parametrize("value", ["NaN", "null", "Infinity", "-Infinity", "1e999"])
def test_one_pixel_that_is_no_number_does_not_cost_the_others(value: str):
    text = f'{{"time_boot": 1, "detections": [{{"u": {value}, "v": 5}}, {{"u": 1, "v": 2, "sigma": 3}}]}}'
    frame = parse_frame(text, ARRIVAL, LIVE)
    assert isinstance(frame, Frame)
    bad, good = frame.detections
    assert math.isnan(bad.u)
    assert bad.v == 5.0
    assert good == Detection(1.0, 2.0, (3.0, 3.0))


@pytest.mark.parametrize(
    ("value", "expected"),
    [("NaN", (0.0, 0.0)), ("[4, Infinity]", (4.0, 0.0)), ("[null, 4]", (0.0, 4.0))],
)
def test_a_sigma_that_is_no_number_is_one_that_pairing_refuses(value: str, expected: tuple[float, float]):
    frame = parse_frame(f'{{"time_boot": 1, "detections": [{{"u": 1, "v": 5, "sigma": {value}}}]}}', ARRIVAL, LIVE)
    assert isinstance(frame, Frame)
    assert frame.detections[0].sigma == expected


def test_a_recording_places_unix_and_boot_and_nothing_else():
    line = '{"time_unix": 1790000001.25, "received_unix": 1790000001.301, "detections": []}'
    frame = parse_frame(line, None, RecordingClock())
    assert isinstance(frame, Frame)
    assert frame.stamp_ns == 1_790_000_001_250_000_000
    assert frame.arrival_ns == 1_790_000_001_301_000_000
    without = parse_frame('{"time_boot": 3, "detections": []}', None, RecordingClock())
    assert isinstance(without, Frame)
    assert without.arrival_ns is None
    refused = parse_frame('{"time_monotonic": 5, "detections": []}', None, RecordingClock())
    assert isinstance(refused, NoFrame)
    assert refused.reason is Reason.NO_MONOTONIC_MAP


def test_live_the_arrival_is_our_own():
    frame = frame_of(**STAMP, received_unix=1.0)
    assert frame.arrival_ns == ARRIVAL


@pytest.mark.parametrize("received", ["1790000001301", "1e308", "-1e308", "1e999", "-5", "NaN", '"now"'])
def test_a_recording_whose_arrival_is_no_instant_is_refused_or_has_none(received: str):
    outcome = parse_frame(f'{{"time_boot": 3, "received_unix": {received}, "detections": []}}', None, RecordingClock())
    assert isinstance(outcome, NoFrame) or received == "-5"


microseconds = st.integers(0, 2_000_000_000_000_000).map(lambda us: us * 1000)
finite = st.floats(allow_nan=False, allow_infinity=False)
detections = st.builds(
    Detection,
    u=finite,
    v=finite,
    sigma=st.none() | st.tuples(finite, finite),
    label=st.text(st.characters(codec="utf-8"), max_size=8),
    score=st.none() | finite,
    box=st.none() | st.tuples(finite, finite, finite, finite),
    detector_id=st.none() | st.integers(-(2**63), 2**63 - 1),
    corners=st.none() | st.tuples(*[st.tuples(finite, finite)] * 4),
)
frames = st.builds(
    Frame,
    number=st.none() | st.integers(-(2**63), 2**63 - 1),
    stamp_ns=microseconds,
    stamp_clock=st.just(StampClock.HOST),
    arrival_ns=st.none() | microseconds,
    detections=st.lists(detections, max_size=3).map(tuple),
    size=st.none() | st.tuples(st.integers(1, 8192), st.integers(1, 8192)),
    exposure_s=st.none() | st.floats(0.0, 10.0),
    picture=st.none(),  # of the camera process alone
)


@settings(max_examples=300, derandomize=True)
@given(frame=frames, offset_us=st.integers(0, 2_000_000_000_000_000))
def test_a_recorded_frame_is_read_back_the_same(frame: Frame, offset_us: int):
    offset_ns = offset_us * 1000
    line = encode_frame(frame, offset_ns)
    assert line.endswith(b"}\n")
    assert line.count(b"\n") == 1
    assert parse_frame(line, None, RecordingClock(offset_ns)) == frame


def test_a_recorded_boot_stamp_stays_one():
    frame = frame_of(time_boot=123.456789, detections=[SEEN])
    line = encode_frame(frame, UNIX_MINUS_HOST)
    assert json.loads(line)["time_boot"] == 123.456789
    assert parse_frame(line, None, RecordingClock(UNIX_MINUS_HOST)) == frame


def test_a_recorded_pixel_that_is_no_number_is_read_back_as_one():
    frame = parse_frame('{"time_boot": 1, "detections": [{"u": NaN, "v": 5, "sigma": NaN}]}', ARRIVAL, LIVE)
    assert isinstance(frame, Frame)
    again = parse_frame(encode_frame(frame, 0), None, RecordingClock())
    assert isinstance(again, Frame)
    assert math.isnan(again.detections[0].u)
    assert again.detections[0].sigma == (0.0, 0.0)


any_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["u", "v", "sigma", "id", "x"]), inner),
    max_leaves=6,
)
field_names = ["time_unix", "time_monotonic", "time_boot", "received_unix", "frame", "size", "exposure_s", "detections"]


@settings(max_examples=400, derandomize=True)
@given(
    st.binary(max_size=60)
    | st.text(st.characters(), max_size=40)
    | st.dictionaries(st.sampled_from(field_names), any_json).map(json.dumps)
)
def test_no_bytes_and_no_json_raise(data: bytes | str):
    for arrival, clocks in ((ARRIVAL, LIVE), (None, RecordingClock())):
        outcome = parse_frame(data, arrival, clocks)
        assert isinstance(outcome, Frame | NoFrame)
        if isinstance(outcome, Frame):
            since_1970_ns = max(0, -outcome.stamp_ns)  # a live stamp of 1970 is before the host's clock began
            assert isinstance(parse_frame(encode_frame(outcome, since_1970_ns), None, RecordingClock()), Frame)


def test_no_damage_to_a_good_datagram_raises():
    good = json.dumps({"time_unix": 1790000001.25, "size": [640, 480], "detections": [SEEN, SEEN]}).encode()
    rng = random.Random(1)
    reasons = set()
    for _ in range(3000):
        data = bytearray(good)
        for _ in range(rng.randint(1, 3)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        outcome = parse_frame(bytes(data), ARRIVAL, LIVE)
        reasons.add(outcome.reason if isinstance(outcome, NoFrame) else None)
    assert {None, Reason.MALFORMED} <= reasons


def test_details_are_short():
    refused = parse_frame(b'{"time_boot": 1, "detections": [], "x": ' + b'"' + b"y" * 100_000, ARRIVAL, LIVE)
    assert isinstance(refused, NoFrame)
    assert len(refused.detail) < 200
    assert msgspec.json.encode(refused)
