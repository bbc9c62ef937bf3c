"""MCAP, GPX and KMZ of ``export``, opened by readers of other projects."""

import base64
import contextlib
import inspect
import io
import itertools
import json
import os
import pty
import re
import shutil
import subprocess
import sys
import tracemalloc
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import foxglove.messages
import gpxpy
import jsonschema
import msgspec
import numpy as np
import pytest
from fastkml import kml
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from fwav_companion.cli.main import main
from fwav_companion.recording.exports.mcap_file import CHUNK_BYTES, HEIGHTS, write_mcap
from fwav_companion.recording.exports.viewer_messages import ViewerMessages, image
from fwav_companion.recording.exports.viewer_schemas import SCHEMAS, TOPICS, schema_text
from fwav_companion.recording.line_types import Line

LAYOUT = Path(__file__).parents[2] / "docs/examples/layout.json"
T0 = 1_790_000_000.0
JPEG = bytes.fromhex("ffd8ffe000104a46494600010100000100010000ffd9")
COV = [[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, 0.25]]


def target(second, **changes):
    usual = {
        "type": "target", "time_unix": T0 + second, "time_boot": 5.0 + second, "frame": int(second), "track": 1,
        "label": "person", "state": "confirmed", "north": 10.0, "east": 20.0, "down": 1.0, "lat": 48.1, "lon": 11.5,
        "alt_amsl": 500.0, "cov": COV, "vel": None, "vel_cov": None,
        "relative": {"north": 10.0, "east": 20.0, "down": 31.0, "cov": COV},
        "fix": {"north": 1, "east": 1, "down": 1, "cov": COV},
    }  # fmt: skip
    return usual | changes


LINES = [
    {"type": "header", "schema": 1, "version": "1", "origin": {"lat": 48.1, "lon": 11.5, "alt_amsl": 500.0},
     "unix_offset_s": T0 - 100.0, "config": {}},
    {"type": "clock", "time_monotonic": 100.5, "time_boot": 5.0, "host_from_autopilot_s": 95.0, "sigma_s": 1e-4,
     "bound_s": 1e-3, "round_trip_s": 2e-3, "rate": 1.0, "utc_minus_time_unix_s": None, "status": "settled"},
    target(1), target(2), target(2, track=2, label="", state="tentative", north=-3.0, vel=[1.0, 0.0, 0.0]),
    {"type": "calibration", "time_unix": T0 + 2.5, "time_offset_s": 0.01, "time_offset_sigma_s": 0.001,
     "mount_deg": [1.0, 2.0, 3.0], "mount_sigma_deg": [0.1, 0.2, 0.3], "status": "calibrated", "reason": None,
     "mistake": "turned by 90 degrees"},
    target(3, state="dropped", reason="not_seen", track=2, label=""),
]  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """A recording as `run` leaves it after kill -9: the last line is cut off."""
    recording = tmp_path / "00001-20260921T141320Z"
    (recording / "pictures").mkdir(parents=True)
    text = "".join(json.dumps(line) + "\n" for line in LINES)
    (recording / "targets.jsonl").write_text(text + '{"type":"target","time_un')
    found = [{"u": 100.0, "v": 50.0, "label": "person", "box": [90, 40, 110, 60]}]
    frames = [{"time_unix": T0 + n, "frame": n, "detections": found} for n in (1, 2)]
    (recording / "detections.jsonl").write_text("".join(json.dumps(frame) + "\n" for frame in frames))
    stamps = [{"file": f"{n:06d}.jpg", "frame": n, "time_unix": T0 + n} for n in (1, 2)]
    (recording / "pictures/stamps.jsonl").write_text("".join(json.dumps(stamp) + "\n" for stamp in stamps))
    for stamp in stamps:
        (recording / "pictures" / stamp["file"]).write_bytes(JPEG)
    return recording


def covariance_of(disc):
    """The covariance in ENU, (2, 2) in one row, of which a turned disc is the 95 % ellipse."""
    q = disc["pose"]["orientation"]
    turn = Rotation.from_quat([q["x"], q["y"], q["z"], q["w"]]).as_matrix()[:2, :2]
    semi = np.array([disc["size"]["x"], disc["size"]["y"]]) / 2.0
    return (turn @ np.diag(semi**2 / chi2.ppf(0.95, 2)) @ turn.T).ravel()


def exported(folder, name, capsys):
    out = folder.parent / name
    assert main(["export", str(folder), "--out", str(out)]) == 0
    assert "1 line is incomplete" in capsys.readouterr().err
    return out.read_bytes()


def read(data):
    """(schema's name, topic, time, content) of every message, each validated against the schema in the file."""
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    messages = []
    for schema, channel, message in reader.iter_messages():
        content = json.loads(message.data)
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        known = json.loads(schema.data)
        jsonschema.validate(content, known)
        messages.append((schema.name, channel.topic, message.log_time, content))
    return messages


def of(messages, topic):
    return [content for _, name, _, content in messages if name == topic]


def test_mcap_has_every_line_picture_and_detection_in_order_of_time(folder, capsys):
    messages = read(exported(folder, "a.mcap", capsys))
    assert all(TOPICS[topic] == schema for schema, topic, _, _ in messages)
    times = [at for _, _, at, _ in messages]
    assert times == sorted(times)
    (clock,) = of(messages, "/clock")
    assert clock["timestamp"] == {"sec": int(T0), "nsec": 500_000_000}
    assert [base64.b64decode(each["data"]) for each in of(messages, "/camera/image")] == [JPEG, JPEG]
    first = of(messages, "/camera/annotations")[0]
    assert first["points"][0]["points"][2] == {"x": 110, "y": 60}
    (calibration,) = of(messages, "/self_calibration")
    assert (calibration["mount_y_deg"], calibration["mount_sigma_z_deg"]) == (2.0, 0.3)
    assert [each["message"] for each in of(messages, "/log")] == [
        "camera mount: turned by 90 degrees", "track 2 dropped: not_seen",
    ]  # fmt: skip


def test_mcap_is_byte_for_byte_what_the_library_writes():
    """Many chunks, all kinds of records, messages in and out of the order of time."""
    viewer = ViewerMessages()
    lines = [*LINES, *(target(n / 10 if n % 7 else 1000.0, track=n % 3) for n in range(3000))]
    messages = [message for line in lines for message in viewer.of_line(msgspec.convert(line, Line))]
    ours, theirs = io.BytesIO(), io.BytesIO()
    write_mcap(ours, messages)
    writer = Writer(theirs, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE)
    writer.start(profile="", library="fwav-companion")
    names = sorted({*TOPICS.values()})
    schemas = {name: writer.register_schema(name, "jsonschema", schema_text(name)) for name in names}
    channels = {topic: writer.register_channel(topic, "json", schemas[name]) for topic, name in TOPICS.items()}
    writer.add_metadata("fwav-companion", HEIGHTS)
    for count, (topic, at_ns, content) in enumerate(messages, 1):
        writer.add_message(channels[topic], at_ns, msgspec.json.encode(content), at_ns, count)
    writer.finish()
    assert len(theirs.getvalue()) > 4 * CHUNK_BYTES
    assert ours.getvalue() == theirs.getvalue()


def test_mcap_without_a_message_can_be_read():
    out = io.BytesIO()
    assert write_mcap(out, []) == 0
    assert make_reader(io.BytesIO(out.getvalue())).get_summary().statistics.message_count == 0


def test_mcap_places_are_enu_with_their_covariance(folder, capsys):
    messages = read(exported(folder, "a.mcap", capsys))
    fix = of(messages, "/targets/location")[0]
    assert fix["position_covariance"] == [9.0, 1.0, 0.0, 1.0, 4.0, 0.0, 0.0, 0.0, 0.25]
    scene = of(messages, "/targets/scene")
    assert scene[0]["entities"][0]["spheres"][0]["pose"]["position"] == {"x": 20.0, "y": 10.0, "z": -1.0}
    assert scene[-1]["deletions"][0]["id"] == "track 2"
    assert covariance_of(scene[0]["entities"][0]["cylinders"][0]) == pytest.approx([9.0, 1.0, 1.0, 4.0])
    assert of(messages, "/tf")[0]["translation"] == {"x": 0.0, "y": 0.0, "z": 30.0}
    vehicle = of(messages, "/vehicle/location")[0]
    assert (vehicle["latitude"], vehicle["altitude"]) == (pytest.approx(48.1), pytest.approx(530.0))
    estimate = of(messages, "/targets/estimates")[0]
    assert (estimate["sigma_north"], estimate["sigma_east"], estimate["sigma_down"]) == (2.0, 3.0, 0.5)


@pytest.mark.parametrize("name", ["a.mcap", "a.kmz", "a.gpx", "a.kml"])
def test_export_twice_gives_the_same_bytes(folder, capsys, name):
    assert exported(folder, name, capsys) == exported(folder, name, capsys)


def test_schemas_have_the_fields_of_foxgloves_own_messages():
    for name, schema in SCHEMAS.items():
        if name.startswith("foxglove."):
            message = getattr(foxglove.messages, name.removeprefix("foxglove."))
            known = set(re.findall(r"\w+", str(inspect.signature(message)).lower()))
            assert {key.lower() for key in schema["properties"]} <= known, name


def walked(tree):
    """Every text of a JSON tree, its keys included."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield key
            yield from walked(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from walked(value)
    elif isinstance(tree, str):
        yield tree


def test_layouts_topics_and_keys_are_those_that_are_written(folder, capsys):
    messages = read(exported(folder, "a.mcap", capsys))
    paths = {text for text in walked(json.loads(LAYOUT.read_text())) if text.startswith("/")}
    assert {path.partition(".")[0] for path in paths} >= {"/camera/image", "/targets/scene", "/clock", "/log"}
    for path in paths:
        topic, _, key = path.partition(".")
        assert topic in TOPICS
        if key:
            assert all(isinstance(each[key], float) for each in of(messages, topic))


def test_layout_shows_every_panel_that_it_configures():
    layout = json.loads(LAYOUT.read_text())
    assert set(layout["configById"]) == {text for text in walked(layout["layout"]) if "!" in text}


def test_gpx_has_a_waypoint_for_each_confirmed_target_and_the_path_of_one_that_moves(folder, capsys):
    walker = [target(n, track=5, lat=48.1 + n * 1e-5, vel=[1.0, 0.0, 0.0]) for n in (3, 4, 5)]
    with (folder / "targets.jsonl").open("r+b") as file:
        whole = file.read().rpartition(b"\n")[0] + b"\n"
        file.seek(0)
        file.write(whole + b"".join(json.dumps(line).encode() + b"\n" for line in walker) + b'{"type":"target","ti')
    gpx = gpxpy.parse(exported(folder, "a.gpx", capsys).decode(), version="1.1")
    first, second = gpx.waypoints
    assert (first.latitude, first.longitude, first.elevation) == (48.1, 11.5, 500.0)
    assert first.time == datetime(2026, 9, 21, 14, 13, 22, tzinfo=UTC)
    assert second.latitude == pytest.approx(48.10005)
    (path,) = gpx.tracks
    assert [point.latitude for point in path.segments[0].points] == pytest.approx([48.10003, 48.10004, 48.10005])


def test_kmz_has_the_picture_of_the_last_sight(folder, capsys):
    with zipfile.ZipFile(io.BytesIO(exported(folder, "a.kmz", capsys))) as archive:
        assert archive.namelist() == ["doc.kml", "pictures/000002.jpg"]
        assert archive.read("pictures/000002.jpg") == JPEG
        document = kml.KML.from_string(archive.read("doc.kml").decode().partition("?>")[2])
    (pin, _ellipse) = document.features[0].features[0].features
    assert 'src="pictures/000002.jpg"' in pin.description


@pytest.mark.parametrize(("out", "told"), [("a.xlsx", "accepted: FILE with .mcap"), ("a", "accepted: FILE with .mcap")])
def test_unknown_suffix_is_one_line(folder, capsys, out, told):
    assert main(["export", str(folder), "--out", str(folder / out)]) == 2
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1


def test_folder_without_targets_is_one_line(folder, capsys):
    (folder / "targets.jsonl").unlink()
    assert main(["export", str(folder), "--out", str(folder / "a.mcap")]) == 2
    assert "it has no targets.jsonl" in capsys.readouterr().err


def test_targets_file_alone_is_enough(folder, capsys):
    alone = folder.parent / "targets.jsonl"
    shutil.copy(folder / "targets.jsonl", alone)
    assert of(read(exported(alone, "b.mcap", capsys)), "/camera/image") == []


def test_damaged_stamp_of_a_picture_is_counted_once(folder, capsys):
    with (folder / "pictures/stamps.jsonl").open("a") as file:
        file.write('{"file":"0000')
    assert main(["export", str(folder), "--out", str(folder / "a.mcap")]) == 0
    assert "2 lines are incomplete" in capsys.readouterr().err


DEEP = b"[" * 5000 + b"]" * 5000


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("pictures/stamps.jsonl", b'{"frame":1,"time_unix":1.0,"file":"\xff"}'),
        ("pictures/stamps.jsonl", b'{"frame":1,"x":' + DEEP + b"}"),
        ("pictures/stamps.jsonl", b'{"frame":1,"time_unix":1e305,"file":"000001.jpg"}'),
        ("pictures/stamps.jsonl", b'{"frame":1,"time_unix":1e18,"file":"000001.jpg"}'),
        ("pictures/stamps.jsonl", b'{"frame":1,"time_unix":' + b"9" * 400 + b',"file":"000001.jpg"}'),
        ("detections.jsonl", b'{"frame":1,"time_unix":1.0,"detections":' + DEEP + b"}"),
        ("detections.jsonl", b'{"frame":1,"time_unix":1.0,"detections":[{"u":1e999}]}'),
        ("detections.jsonl", b'{"frame":1,"time_unix":1.0,"detections":[{"label":"\xff"}]}'),
        ("detections.jsonl", b'{"frame":1,"time_unix":1.0,"detections":[{"u":"x","v":1}]}'),
        ("targets.jsonl", json.dumps(target(1e18)).encode()),
        ("targets.jsonl", b'{"type":"header","version":"1","origin":null,"unix_offset_s":1e308}'),
    ],
)
def test_export_leaves_out_the_lines_of_a_strangers_recording_that_cannot_be_read(folder, capsys, name, line):
    file = folder / name
    file.write_bytes(line + b"\n" + file.read_bytes())
    assert main(["export", str(folder), "--out", str(folder / "a.mcap")]) == 0
    assert "2 lines are incomplete" in capsys.readouterr().err
    messages = read((folder / "a.mcap").read_bytes())
    assert len(of(messages, "/camera/image")) == len(of(messages, "/camera/annotations")) == 2


def test_export_does_not_wait_for_a_picture_that_is_a_pipe(folder, capsys):
    (folder / "pictures/000001.jpg").unlink()
    os.mkfifo(folder / "pictures/000001.jpg")
    assert len(of(read(exported(folder, "a.mcap", capsys)), "/camera/image")) == 1


def test_pictures_after_the_last_line_are_in_the_file(folder, capsys):
    (folder / "pictures/000009.jpg").write_bytes(JPEG)
    with (folder / "pictures/stamps.jsonl").open("a") as file:
        file.write(json.dumps({"file": "000009.jpg", "frame": 9, "time_unix": T0 + 9}) + "\n")
    messages = read(exported(folder, "a.mcap", capsys))
    assert messages[-1][1:3] == ("/camera/image", round((T0 + 9) * 1e9))
    times = [at for _, _, at, _ in messages]
    assert times == sorted(times)


@pytest.mark.parametrize("picture_bytes", [0, 40_000])
def test_memory_of_mcap_does_not_grow_with_the_flight(tmp_path, picture_bytes):
    def peak(count):
        viewer = ViewerMessages()
        lines = [msgspec.convert(line, Line) for line in (LINES[0], *(target(n / 10) for n in range(6)))]
        messages = (message for n in range(count) for message in viewer.of_line(lines[n % len(lines)]))
        if picture_bytes:
            pictures = (image(n * 10**9, bytes(picture_bytes), "jpeg") for n in range(count // 10))
            messages = itertools.chain(messages, pictures)
        with (tmp_path / "a.mcap").open("wb") as file:
            tracemalloc.start()
            write_mcap(file, messages)
            _, most = tracemalloc.get_traced_memory()
            tracemalloc.stop()
        return most

    peak(100)
    few, many = peak(1_500), peak(4_500)
    assert many < 1.25 * few


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_bar_is_on_a_terminal_and_not_in_a_pipe(folder, terminal):
    ours, theirs = pty.openpty() if terminal else os.pipe()
    command = [sys.executable, "-m", "fwav_companion", "export", str(folder), "--out", str(folder.parent / "a.mcap")]
    done = subprocess.run(
        command, stderr=theirs, stdout=subprocess.PIPE, timeout=60, env=os.environ | {"TERM": "xterm"}
    )
    os.close(theirs)
    written = b""
    with contextlib.suppress(OSError):  # a terminal whose other end is closed
        while part := os.read(ours, 65536):
            written += part
    os.close(ours)
    assert (done.returncode, done.stdout) == (0, b"")
    assert (b"100%" in written) == terminal
    assert b"1 line is incomplete" in written
