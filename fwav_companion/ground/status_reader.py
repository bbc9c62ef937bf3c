"""SHELL: reads the status of a `run` on this board or another: all its tracks, and the findings of `check`."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiohttp
import msgspec

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.ground.covariances import ellipse_of, from_triangle
from fwav_companion.ground.picture import GroundPicture, readiness_fields, targets_of
from fwav_companion.ground.views import TargetView
from fwav_companion.types.flight_status import TrackReport
from fwav_companion.types.status import RunStatus

PERIOD_S = 1.0
"""The service rewrites the file each second."""
STALE_S = 5.0
CHECK_PERIOD_S = 10.0
MAX_BYTES = 262_144
"""Most bytes that are read: four times the largest status."""
TIMEOUT_S = 5.0
MAX_CHECKS = 12

Understand = Callable[[Any], RunStatus | None]
"""Function that converts decoded JSON to a status; None if it is not one."""
Judge = Callable[[RunStatus], tuple[str, ...]]
"""Function that gives the findings of `check` for a status. It may block."""


class StatusReader:
    """Reads one status, from a file or over HTTP, once a second."""

    def __init__(
        self,
        where: str,
        picture: GroundPicture,
        *,
        clock: Callable[[], float],
        understand: Understand,
        judge: Judge,
    ) -> None:
        self._where, self._picture, self._clock = where, picture, clock
        self._understand, self._judge = understand, judge
        self._task: asyncio.Task[None] | None = None
        self._checks: tuple[str, ...] = ()
        self._judged_unix = 0.0
        self._newest = 0.0
        self._changed_unix = 0.0

    def start(self) -> None:
        """Begin to read."""
        self._task = asyncio.get_running_loop().create_task(self._read_each_second())

    def tick(self, now: float) -> None:
        """Do nothing: the reading task does all the work."""

    def close(self) -> None:
        """Stop reading."""
        if self._task is not None:
            self._task.cancel()

    async def _read_each_second(self) -> None:
        while True:
            try:
                status = self._understand(msgspec.json.decode(await self._bytes()))
            except (OSError, aiohttp.ClientError, TimeoutError) as error:
                why = getattr(error, "strerror", None) or str(error) or type(error).__name__
                self._picture.on_source(self._where, works=False, text=f"not readable: {why}")
            except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
                self._on_strange()
            else:
                await self._take_or_report(status)
            await asyncio.sleep(PERIOD_S)

    async def _take_or_report(self, status: RunStatus | None) -> None:
        """Take a status. A fault costs this status alone: without the task an old picture would stay for good."""
        if status is None:
            self._on_strange()
            return
        try:
            await self._take(status)
        except Exception as error:  # noqa: BLE001  # it is logged: a file may hold any values
            self._on_strange()
            context = {"message": f"{self._where} was not taken", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)

    def _on_strange(self) -> None:
        self._picture.on_source(self._where, works=False, text="not a status of fwav-companion")

    async def _bytes(self) -> bytes:
        if not self._where.startswith(("http://", "https://")):
            return await asyncio.to_thread(_head, Path(self._where))
        timeout = aiohttp.ClientTimeout(total=TIMEOUT_S)
        async with aiohttp.ClientSession(timeout=timeout) as session, session.get(self._where) as answer:
            answer.raise_for_status()
            content = bytearray()
            while len(content) < MAX_BYTES and (chunk := await answer.content.read(MAX_BYTES)):  # as they come
                content += chunk
            return bytes(content[:MAX_BYTES])

    async def _take(self, status: RunStatus) -> None:
        now = self._clock()
        if status.time_monotonic != self._newest:
            self._newest, self._changed_unix = status.time_monotonic, now
        stale = now > self._changed_unix + STALE_S
        text = f"not rewritten for {now - self._changed_unix:.0f} s: is the service running?" if stale else "read"
        if not stale and now >= self._judged_unix + CHECK_PERIOD_S:
            self._judged_unix = now
            self._checks = (await asyncio.to_thread(self._judge, status))[:MAX_CHECKS]
        if status.autopilot is None and not stale:  # there is no vehicle yet to show the findings of `check` at
            text = f"read, no autopilot yet. {'; '.join(self._checks[:1])}".strip()
        self._picture.on_source(self._where, works=not stale, text=text)
        if status.autopilot is None or stale:
            return
        vehicle = str(status.autopilot.system)
        known = self._picture.vehicles.get(vehicle)
        fields: dict[str, Any] = {"checks": self._checks, "armed": status.autopilot.armed, "companion": "healthy"}
        if status.obstacle is not None:
            fields |= readiness_fields(known, ready=not status.obstacle, trouble=status.obstacle)
        if status.footprint:
            fields["footprint"] = tuple(status.footprint)
        fields["contradicted"] = vehicle_contradiction(status)
        self._picture.on_vehicle(vehicle, now, heard=evidence_of(status, self._changed_unix), **fields)
        self._show(vehicle, status, now)

    def _show(self, vehicle: str, status: RunStatus, now: float) -> None:
        """Show its tracks, and remove those that the status no longer has."""
        tracks = status.tracks
        shown = {f"{vehicle}/{track.track}" for track in tracks}
        for old in targets_of(self._picture, "status"):
            if old.id not in shown and old.vehicle == vehicle:
                self._picture.remove_target(old.id)
        for track in tracks:
            view = view_of(vehicle, track, now, target_contradiction(status, track))
            if view is not None:
                self._picture.on_target(view, now)


def evidence_of(status: RunStatus, at_unix: float) -> dict[str, float]:
    """The instants of the evidence in a status of this instant, by part and value."""
    ages = {"companion": 0.0, "detector": status.intake.age_s}
    if status.obstacle is not None:
        ages["readiness"] = 0.0
    if status.autopilot is not None:
        ages["autopilot"] = status.autopilot.age_s
    if status.vision is not None and status.vision.works:
        ages["camera"] = 0.0
    return {name: at_unix - age_s for name, age_s in ages.items() if age_s is not None}


def vehicle_contradiction(status: RunStatus) -> str:
    """What contradicts every claim of this vehicle; "": nothing that is known."""
    if status.calibration is not None and status.calibration.mistake:
        return f"camera mount: {status.calibration.mistake}"
    for landmark in status.seen.landmarks:
        if landmark.contradicts:
            return f"landmarks {', '.join(sorted((landmark.label, *landmark.contradicts)))} contradict one another"
    return ""


def target_contradiction(status: RunStatus, track: TrackReport) -> str:
    """What contradicts the claim of this track; "": nothing that is known."""
    agreement = status.seen.agreement
    if not agreement.disagrees or agreement.label != track.label:
        return ""
    but = "" if agreement.turn_deg is not None else ", unless it moves"
    return f"its fixes disagree by {agreement.apart_m:.1f} m (median), more than is claimed{but}"


def view_of(vehicle: str, track: TrackReport, now: float, contradicted: str = "") -> TargetView | None:
    """The track as a target of the picture; None without a place on the earth."""
    if track.lat is None or track.lon is None:
        return None
    cov = from_triangle(track.cov)
    return TargetView(
        id=f"{vehicle}/{track.track}",
        vehicle=vehicle,
        track=str(track.track),
        label=track.label,
        state=track.state,
        lat=track.lat,
        lon=track.lon,
        alt_amsl=track.alt_amsl,
        ellipse=None if cov is None else ellipse_of(cov),
        radius95_m=None if cov is None else radius_95(cov),
        contradicted=contradicted,
        first_unix=now - track.first_seen_s,
        seen_unix=now - track.last_seen_s,
        source="status",
    )


def _head(path: Path) -> bytes:
    """The first MAX_BYTES of the file, longer than any status."""
    with path.open("rb") as file:
        return file.read(MAX_BYTES)
