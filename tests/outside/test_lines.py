"""Every key of the files of a flight: targets, detections, and its part of the status."""

import json

from flights import detection_lines, dropped_for, flights, statuses, target_lines
from frozen import hold, keys

from fwav_companion.recording.line_decoder import read_lines
from fwav_companion.recording.lines import encode_line

STATUS_TABLES = {
    "status.dropped",
    "status.parameters",
    "status.publishing.landing.withheld",
    "status.rates",
    "status.sight.ground.fallbacks",
    "status.telemetry.rates_hz",
    "status.telemetry.refused",
    "status.timesync.ignored",
}
LINE_KINDS = ("header", "origin", "home", "clock", "calibration", "sighting", "target", "summary")


def test_the_lines_of_a_targets_file():
    lines = list(target_lines())
    for kind in sorted({line["type"] for line in lines} | set(LINE_KINDS)):
        assert any(line["type"] == kind for line in lines), f"no flight wrote a line of type {kind}"
    facts = {
        fact
        for kind in {line["type"] for line in lines}
        for fact in keys(
            [line for line in lines if line["type"] == kind],
            kind,
            tables={"summary.dropped"},
            opaque={"header.config"},
        )
    }
    values = {f"{line['type']}.{key} = {line[key]}" for line in lines for key in ("type", "schema") if key in line}
    hold("targets", facts | values)


def test_every_line_of_a_flight_is_decoded_and_encoded_to_its_bytes():
    for flight in flights():
        written = flight.targets_file().splitlines(keepends=True)
        read = read_lines(written)
        assert (read.damaged, read.unknown) == (0, 0)
        assert list(map(encode_line, read.lines)) == written


def test_a_header_comes_first_and_a_summary_last():
    for flight in flights():
        types = [json.loads(line)["type"] for line in flight.targets_file().splitlines()]
        assert (types[0], types[-1]) == ("header", "summary")
        assert types.count("header") == types.count("summary") == 1


def test_the_lines_of_recorded_detections():
    hold("detections", keys(detection_lines(), "frame", tables={"frame.refused"}))


def test_what_a_flight_gives_to_the_status_file():
    """Keys and kinds of values, for every ground model and a gimbal; test_live.py has the service's own part."""
    hold("status_of_flights", keys(statuses(), "status", tables=STATUS_TABLES))


def test_the_fields_of_a_detectors_frame():
    """The reason for which a frame is refused if one field is missing or wrong; unknown fields are ignored."""
    seen = {"u": 1.5, "v": 2.5, "sigma": 4.0, "label": "a", "score": 0.5, "box": [0.0, 0.0, 3.0, 3.0], "id": 7}
    frame = {"time_monotonic": 999.5, "frame": 37, "size": [640, 480], "exposure_s": 0.004, "detections": [seen]}
    assert dropped_for(frame) == ""
    facts = {f"frame with an unknown field: {dropped_for(frame | {'unknown': {}})}"}
    for time in ("time_monotonic", "time_boot", "time_unix"):
        bare = {key: value for key, value in frame.items() if key != "time_monotonic"}
        facts.add(f"{time} alone, not of now: {dropped_for(bare | {time: 1e30})}")
        facts.add(f"{time} beside time_monotonic of now: {dropped_for(frame | {time: 999.5})}")
    for key in frame:
        facts.add(f"{key} is a table: {dropped_for(frame | {key: {}})}")
        facts.add(f"{key} is missing: {dropped_for({name: value for name, value in frame.items() if name != key})}")
    for key in seen:
        wrong, without = seen | {key: {}}, {name: value for name, value in seen.items() if name != key}
        facts.add(f"detections[].{key} is a table: {dropped_for(frame | {'detections': [wrong]})}")
        facts.add(f"detections[].{key} is missing: {dropped_for(frame | {'detections': [without]})}")
    facts.add(f"257 detections: {dropped_for(frame | {'detections': [seen] * 257})}")
    facts.add(f"256 detections: {dropped_for(frame | {'detections': [seen] * 256})}")
    hold("detections_in", {fact.strip() for fact in facts})
