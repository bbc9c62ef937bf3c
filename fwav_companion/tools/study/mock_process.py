"""SHELL: the mock autopilot and camera as a long-lived process that flies one flight after the other.

``python -m sitl_mock --serve``: a line of JSON asks for a flight, a line of JSON and the announced bytes answer it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Self

import msgspec

from fwav_companion.errors import CompanionError

COMMAND: Final = (sys.executable, "-m", "sitl_mock", "--serve")
FORMAT: Final = 1
STOP_S: Final = 5.0
"""Time that the process has to end after its stdin was closed, seconds."""


class MockError(CompanionError):
    """The mock refused a flight, or ended."""


class FlownFlight(msgspec.Struct, frozen=True, kw_only=True):
    """A recording in memory, and the truth about it."""

    telemetry: bytes
    """Telemetry, a .tlog."""
    detections: bytes
    """Detections, JSON lines."""
    truth: str
    """True positions, CSV."""
    frames: int
    in_view: int
    """Pictures in which the target was in view."""
    biases: dict[str, Any]
    """Drawn errors by the mock's names."""


class MockProcess:
    """One process of the mock. It ends with this object, and with the process that holds it."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(  # noqa: S603  # our own interpreter and module
            COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def fly(self, request: dict[str, Any]) -> FlownFlight:
        """One flight. MockError."""
        if self._process.stdin is None or self._process.stdout is None:
            raise MockError("the mock has no pipes")
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            raise MockError(f"the mock ended with status {self._process.wait(STOP_S)}") from None
        line = self._process.stdout.readline()
        if not line:
            raise MockError(f"the mock ended with status {self._process.wait(STOP_S)}")
        header = json.loads(line)
        if "error" in header:
            raise MockError(f"the mock cannot fly this: {header['error']}")
        if header["format"] != FORMAT:
            raise MockError(f"the mock answers in format {header['format']}, expected {FORMAT}")
        telemetry, detections, truth = (self._read(header[name]) for name in ("telemetry", "detections", "truth_csv"))
        return FlownFlight(
            telemetry=telemetry,
            detections=detections,
            truth=truth.decode(),
            frames=header["frames"],
            in_view=header["in_view"],
            biases=header["biases"],
        )

    def close(self) -> None:
        """End the process."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # a request that a dead process did not read
                    pipe.close()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _read(self, count: int) -> bytes:
        data = b"" if self._process.stdout is None else self._process.stdout.read(count)
        if len(data) < count:
            raise MockError("the mock ended within a flight")
        return data
