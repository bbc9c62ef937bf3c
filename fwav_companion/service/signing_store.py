"""SHELL: the signing timestamp, kept across restarts: receivers reject one that goes back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec

from fwav_companion.config import Config
from fwav_companion.mavlink.wire.signing import SigningClock, starting_timestamp
from fwav_companion.service.latest_file import LatestFile, state_path

NAME = "signing.json"
NOT_KEPT = "the signing time is not kept: set [state] directory or $STATE_DIRECTORY"
EVERY_TICKS = 60
"""Written once a minute, as the MAVLink guide asks; a restart continues two minutes after the kept one."""


class SigningStore:
    """Reads the timestamp at the start and writes it once a minute, where there is a state directory."""

    def __init__(self, config: Config, on_failure: Callable[[str], None]) -> None:
        configured = config.state.directory
        self._path: Path | None = None
        if config.signing is not None:
            self._path = state_path(config.resolve(configured) if configured else None, NAME)
        self._warning = "" if config.signing is None or self._path is not None else NOT_KEPT
        self._on_failure = on_failure
        self._file = None if self._path is None else LatestFile([self._path], on_failure, outlives_us=True)
        self._ticks = 0

    def starting_timestamp(self, unix_ns: int) -> int:
        """First timestamp of this run's signatures."""
        return starting_timestamp(self._kept(), unix_ns)

    def start(self) -> None:
        """Start the writer; warn where there is no directory for it."""
        if self._warning:
            self._on_failure(self._warning)
        if self._file is not None:
            self._file.start()

    def tick(self, clock: SigningClock | None) -> None:
        """Take the newest timestamp, once a second."""
        if self._file is not None and clock is not None and self._ticks % EVERY_TICKS == 0:
            self._file.write(msgspec.json.encode(clock.timestamp))
        self._ticks += 1

    def close(self, timeout_s: float) -> None:
        """Write what waits, and stop the writer."""
        if self._file is not None:
            self._file.close(timeout_s)

    def _kept(self) -> int | None:
        try:
            return None if self._path is None else msgspec.json.decode(self._path.read_bytes(), type=int)
        except (OSError, msgspec.DecodeError):  # the first run, or a file that a power cut left empty
            return None
