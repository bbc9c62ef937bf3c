"""SHELL: ``check --click-delay``: runs the service while an operator clicks on a blinking object."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Final

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.telemetry import Telemetry
from fwav_companion.tools.doctor.click_delay import (
    Blinking,
    ClickDelay,
    NoClickDelay,
    click_delay,
    distinct,
    rhythm_s,
)
from fwav_companion.tools.doctor.gathering import quiet
from fwav_companion.types import Frame, Message, NoFrame, StampClock
from fwav_companion.types.status import RunStatus

WANTED_CLICKS: Final = 10
"""Clicks needed: their mean is known to a third of one click's scatter, 0.02 s."""
TRACKING_COMMANDS: Final = frozenset({2004, 2005})
"""MAV_CMD_CAMERA_TRACK_POINT and _RECTANGLE."""


class ClickDelaySession:
    """Keeps the instants at which the object appeared and at which the operator clicked."""

    def __init__(
        self,
        time_offset_s: float,
        *,
        wait_s: float,
        show: Callable[[str], None],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """``time_offset_s``: offset of the frames' stamps. ``show``: displays instructions."""
        self._time_offset_s, self._show, self._now_s = time_offset_s, show, now_s
        self._ends_s = now_s() + wait_s
        self._blinking = Blinking()
        self._clicks: list[float] = []

    def on_frame(self, frame: Frame | NoFrame) -> None:
        """Take a frame of any source."""
        if isinstance(frame, NoFrame):
            return
        on_host = frame.stamp_clock is StampClock.HOST or frame.arrival_ns is None
        at_ns = frame.stamp_ns if on_host else frame.arrival_ns or 0
        self._blinking.add(at_ns * 1e-9 - self._time_offset_s, (each.label for each in frame.detections))

    def on_message(self, message: Message) -> None:
        """Take a message; clicks count."""
        if message.name in ("COMMAND_LONG", "COMMAND_INT") and message.fields.command in TRACKING_COMMANDS:
            self._clicks.append(self._now_s())

    def enough(self, _status: RunStatus, _telemetry: Telemetry) -> bool:
        """Whether there are enough clicks, or the time is over; shows the next step."""
        clicks = len(distinct(self._clicks))
        rhythm = rhythm_s(self._blinking.onsets)
        if isinstance(rhythm, NoClickDelay):
            self._show(f"waiting: {rhythm.why}")
        else:
            self._show(f"click on it each time that it appears: {clicks} of {WANTED_CLICKS} clicks")
        return clicks >= WANTED_CLICKS or self._now_s() > self._ends_s

    def result(self) -> ClickDelay | NoClickDelay:
        """The delay, or why there is none."""
        return click_delay(self._blinking.onsets, self._clicks)


def measure_click_delay(
    config: Config,
    calibration: Calibration,
    signing_key: bytes | None,
    *,
    wait_s: float,
    show: Callable[[str], None],
) -> ClickDelay | NoClickDelay:
    """Run the service, with its camera component, until the operator has clicked enough."""
    from fwav_companion.service.daemon import Service

    logging.getLogger("fwav_companion").addHandler(logging.NullHandler())
    listening = quiet(config)
    listening = msgspec.structs.replace(
        listening, publish=msgspec.structs.replace(listening.publish, camera_tracking=True)
    )
    session = ClickDelaySession(config.camera.time_offset_s, wait_s=wait_s, show=show)

    async def attend() -> None:
        service = Service(listening, calibration, signing_key, elevation=(), extra_files={})
        await service.attend(session)

    asyncio.run(attend())
    return session.result()
