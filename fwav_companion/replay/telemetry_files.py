"""SHELL: reads the telemetry of a recording and recognizes its kind by content: .tlog, ArduPilot .bin, PX4 .ulg."""

from __future__ import annotations

from pathlib import Path

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content, open_regular
from fwav_companion.recording.ardupilot_log import read_ardupilot_log
from fwav_companion.recording.dataflash import is_dataflash
from fwav_companion.recording.tlog import load_tlog
from fwav_companion.recording.ulog import is_ulog, read_ulog
from fwav_companion.replay.telemetry import TelemetryRead, of_log, read_telemetry

HEAD_BYTES = 256
"""Number of leading bytes of a telemetry file that identify its kind."""
DATAFLASH_AS_TEXT = b"FMT, 128, 89, FMT"
"""Beginning of an ArduPilot log that a tool converted to text; older ones have a line or two before it."""
PACKED = {b"\x1f\x8b": "gzip", b"\xfd7zXZ\0": "xz", b"PK\x03\x04": "zip", b"BZh": "bzip2", b"(\xb5/\xfd": "zstd"}
"""Beginnings of compressed files, as logs are often passed on."""
TIME_IN_MS = b"TimeMS,"
"""Time column in the message descriptions of a log from before TimeUS."""

ACCEPTED = "accepted: a .tlog, .bin or .ulg recording"


def load_telemetry(path: Path, own: frozenset[int]) -> TelemetryRead:
    """The telemetry in a file of any of the three kinds. InputFileError."""
    try:
        with open_regular(path) as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {ACCEPTED}") from None
    if is_ulog(head):
        log, skipped, damaged = read_ulog(path)
        notes = ["some of its messages are damaged and were left out"] if damaged else []
        return of_log(str(path), log, own=own, skipped=skipped, notes=notes)
    if is_dataflash(head):
        return _ardupilot_log(path, own)
    if DATAFLASH_AS_TEXT in head:
        raise InputFileError(f"{path}: an ArduPilot log as text; accepted: the .bin from which it was made")
    for begins, kind in PACKED.items():
        if head.startswith(begins):
            raise InputFileError(f"{path}: compressed ({kind}); {ACCEPTED}, unpacked")
    data = load_tlog(path)
    telemetry = read_telemetry(data)
    if data and not telemetry.messages:  # in megabytes of any data some bytes look like a record
        raise InputFileError(
            f"{path}: no readable MAVLink message in its {len(data)} bytes, and it does not begin as a log does; "
            f"{ACCEPTED}"
        )
    return telemetry


def _ardupilot_log(path: Path, own: frozenset[int]) -> TelemetryRead:
    try:
        data = content(path)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {ACCEPTED}") from None
    log, skipped = read_ardupilot_log(data)
    if not log.attitudes and TIME_IN_MS in data:
        raise InputFileError(
            f"{path}: its times are TimeMS, as ArduPilot wrote them until 2014: whole milliseconds, without UTC and "
            "without POS; accepted: a log with TimeUS"
        )
    return of_log(str(path), log, own=own, skipped=skipped, notes=[])
