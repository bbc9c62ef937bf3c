"""SHELL: the daemon. It puts its parts together, starts them, and stops them within two seconds."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.localization import ElevationTile
from fwav_companion.service.background_solver import BackgroundSolver
from fwav_companion.service.dispatcher import Dispatcher
from fwav_companion.service.housekeeping import Housekeeping
from fwav_companion.service.latest_file import LatestFile, status_paths
from fwav_companion.service.log import warn
from fwav_companion.service.other_run import other_run
from fwav_companion.service.parts import make_parts
from fwav_companion.service.service_factory import make_detections, make_fleet, make_vision
from fwav_companion.service.status import StatusReport, SystemdNotifier
from fwav_companion.service.stop_signals import end_by
from fwav_companion.service.witness import Witness
from fwav_companion.types import Notice
from fwav_companion.types.status import RunStatus

SOLVER_STOP_S = 0.1
"""Time in which a piece of a solve ends; a thread that takes longer is left behind."""
FILE_STOP_S = 0.4
"""Time to close each file: four of them stay below the two seconds that a stop may take."""
WITNESS_INTERVAL_S = 0.2


class Service:
    """One run of the daemon."""

    def __init__(
        self,
        config: Config,
        calibration: Calibration | None,
        signing_key: bytes | None,
        *,
        elevation: Sequence[ElevationTile],
        extra_files: Mapping[str, bytes],
        attitudes_kept_s: float | None = None,
        solver: BackgroundSolver | None = None,
    ) -> None:
        """``elevation``: the tiles of [ground] terrain. ``solver``: computes the smoother's solves; None: without it.

        ``extra_files``: files that are kept with a flight's recording, by name. ``attitudes_kept_s``: length of the
        attitude history for a witness that reads it afterwards.
        """
        self._parts = parts = make_parts(
            config,
            calibration,
            signing_key,
            elevation=elevation,
            extra_files=extra_files,
            attitudes_kept_s=attitudes_kept_s,
            solver=solver,
        )
        self._dispatcher = Dispatcher(parts)
        self._fleet = make_fleet(
            config, parts.pipeline, now=parts.clock.now, warn=warn, on_notice=self._on_fleet_notice
        )
        self._detections = self._vision = None
        if calibration is not None:
            receiver, camera = self._dispatcher.receiver, self._dispatcher.camera
            self._detections = make_detections(config, receiver, parts.log.detections_heard)
            self._vision = camera.vision = make_vision(
                config, calibration.image_size, receiver, on_state=parts.log.pictures_seen, desk=camera
            )
        self._status_paths = status_paths(config.status_path)
        self._status_file = LatestFile(self._status_paths, warn, outlives_us=False)
        self._status = StatusReport(parts, self._dispatcher.links, self._vision)
        self._notifier = SystemdNotifier()
        self._housekeeping = Housekeeping(
            parts,
            self._dispatcher,
            self._status,
            self._status_file,
            notifier=self._notifier,
            utc_leaves=self._dispatcher.map_link is not None or self._fleet is not None,
        )
        self._stop = asyncio.Event()
        self._misconfigured = False

    async def run(self) -> None:
        """Run until SIGTERM, SIGINT or SIGHUP, then stop within two seconds.

        ConfigError where the first messages, on the ground, contradict the configuration.
        """
        loop = asyncio.get_running_loop()
        end_by(loop, self._stop.set)
        self._dispatcher.on_misconfigured = self._on_misconfigured
        loop.set_exception_handler(self._dispatcher.on_internal_fault)
        self._start()
        await self._stop.wait()
        self._notifier.stopping()
        self._close()
        if self._misconfigured:
            raise self._parts.config.heard_follow_id()

    async def listen(self, seconds: float) -> RunStatus:
        """Run for this time and return the status at its end. For ``check``."""
        self._start()
        try:
            await asyncio.sleep(seconds)
            status = self._status.at(self._parts.clock.now())
        finally:
            self._close()
        return status

    async def attend(self, witness: Witness) -> None:
        """Run until the witness has seen enough. For ``check --shake``."""
        parts, self._dispatcher.witness = self._parts, witness
        self._start()
        try:
            while not witness.enough(self._status.at(parts.clock.now()), parts.pipeline.telemetry):  # noqa: ASYNC110
                # The answer depends on the time as well: there is no event to wait for.
                await asyncio.sleep(WITNESS_INTERVAL_S)
        finally:
            self._close()

    def _start(self) -> None:
        parts, dispatcher = self._parts, self._dispatcher
        parts.log.accompanied(other_run(self._status_paths))
        parts.journal.start(parts.kept)
        files = (self._status_file, parts.signing, parts.calibrations)
        inputs = (self._detections, self._vision, dispatcher.map_link, self._fleet)
        for part in (*files, *inputs, *dispatcher.links.values()):
            if part is not None:
                part.start()
        parts.signing.begin(parts.node.signing_clock, parts.clock.now())
        parts.log.started(hears_detections=self._detections is not None)
        self._notifier.ready()
        self._housekeeping.tick()
        dispatcher.on_alarm()

    def _close(self) -> None:
        parts, dispatcher = self._parts, self._dispatcher
        now = parts.clock.now()
        for step in (parts.journal.tick, parts.pipeline.finish, dispatcher.flush, parts.journal.end):
            try:
                step(now)
            except Exception as error:  # noqa: BLE001  # what comes after it is closed all the same
                parts.log.faulted({"message": "at the end of the run", "exception": error})
        inputs = (self._detections, self._vision, dispatcher.map_link, self._fleet)
        for part in (*inputs, *dispatcher.links.values()):
            if part is not None:
                part.close()
        if parts.solver is not None:
            parts.solver.close(SOLVER_STOP_S)
        for file in (parts.journal, self._status_file, parts.signing, parts.calibrations):
            file.close(FILE_STOP_S)
        self._notifier.close()
        parts.log.stopped()

    def _on_misconfigured(self) -> None:
        self._misconfigured = True
        self._stop.set()

    def _on_fleet_notice(self, notice: Notice) -> None:
        self._dispatcher.report([notice], self._parts.clock.now())
