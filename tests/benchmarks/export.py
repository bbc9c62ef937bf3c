"""A recording as MCAP, against the mcap library's own writing of the same messages, ready-made.

``python -m tests.benchmarks.export``
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from pathlib import Path

import msgspec
import numpy as np
from mcap.writer import CompressionType, Writer

from fwav_companion.cli.export_inputs import RecordedFlight
from fwav_companion.recording.exports.mcap_file import CHUNK_BYTES, write_mcap
from fwav_companion.recording.exports.viewer_scene import Message
from fwav_companion.recording.exports.viewer_schemas import TOPICS, schema_text
from sitl_mock import scenario
from sitl_mock.recording import record
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.startup import relay_configuration

SECONDS, PICTURES_HZ, PICTURE_BYTES = 180.0, 2.0, 40_000
BUDGET = 2.0
CONFIGURATION = '\n[camera]\ncalibration = "made/camera.yaml"\n'


def measure() -> list[Figure]:
    """The ratio for the lines alone, and with pictures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            [sys.executable, "-m", "fwav_companion", "init", "made"], cwd=folder, check=True, capture_output=True
        )
        record(scenario("default").but({"seconds": SECONDS}), folder)
        (folder / "flight.toml").write_text(relay_configuration(24598) + CONFIGURATION)
        files = ["--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--out", "targets.jsonl"]
        command = [sys.executable, "-m", "fwav_companion", "replay", "--config", "flight.toml", *files]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        _add_pictures(folder)
        return [
            _figure("export to MCAP, lines alone", folder / "targets.jsonl"),
            _figure(f"export to MCAP, {PICTURES_HZ:g} pictures a second", folder),
        ]


def _add_pictures(folder: Path) -> None:
    times = [line["time_unix"] for line in map(msgspec.json.decode, (folder / "targets.jsonl").open("rb"))
             if line["type"] == "target"]  # fmt: skip
    stamps = []
    (folder / "pictures").mkdir()
    for k in range(round(SECONDS * PICTURES_HZ)):
        content = np.random.default_rng(k).bytes(PICTURE_BYTES)
        (folder / f"pictures/{k:06d}.jpg").write_bytes(content)
        stamps.append({"file": f"{k:06d}.jpg", "frame": k, "time_unix": times[0] + k / PICTURES_HZ})
    (folder / "pictures/stamps.jsonl").write_bytes(b"\n".join(map(msgspec.json.encode, stamps)))


def _exported(recording: Path) -> bytes:
    flight, out = RecordedFlight(recording), io.BytesIO()
    with flight.watched() as lines:
        write_mcap(out, flight.messages(lines))
    return out.getvalue()


def _ready_made(recording: Path) -> list[tuple[str, int, bytes]]:
    def encoded(message: Message) -> tuple[str, int, bytes]:
        return message[0], message[1], msgspec.json.encode(message[2])

    flight = RecordedFlight(recording)
    with flight.watched() as lines:
        return [encoded(message) for message in flight.messages(lines)]


def _written(messages: list[tuple[str, int, bytes]]) -> bytes:
    """The library alone."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE)
    writer.start(profile="", library="")
    schemas = {name: writer.register_schema(name, "jsonschema", schema_text(name)) for name in {*TOPICS.values()}}
    channels = {topic: writer.register_channel(topic, "json", schemas[name]) for topic, name in TOPICS.items()}
    for count, (topic, at_ns, content) in enumerate(messages):
        writer.add_message(channels[topic], at_ns, content, at_ns, count)
    writer.finish()
    return out.getvalue()


def _figure(name: str, recording: Path) -> Figure:
    messages = _ready_made(recording)
    ours_s, theirs_s = interleaved(lambda: _exported(recording), lambda: _written(messages))
    detail = f"{len(messages)} messages of {SECONDS:.0f} s; the library {theirs_s * 1e3:.0f} ms"
    return Figure(f"{name}, x of the mcap library", ours_s / theirs_s, BUDGET, False, detail)


if __name__ == "__main__":
    print(*measure(), sep="\n")
