"""SHELL: the parts of a run without callbacks to other parts: clock, log, pipeline, MAVLink node, recording, stores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.localization import ElevationTile
from fwav_companion.mavlink.router.node import Node
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.service.background_solver import BackgroundSolver
from fwav_companion.service.board import board_name, wall_clock_is_synchronised
from fwav_companion.service.calibration_store import CalibrationStore
from fwav_companion.service.journal import Journal
from fwav_companion.service.log import ServiceLog, warn
from fwav_companion.service.network import make_node
from fwav_companion.service.service_factory import make_recorder
from fwav_companion.service.signing_store import SigningStore
from fwav_companion.service.timer import HostClock
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions


class ArrivalCount:
    """Count of all frames that arrive, used or not, from another process or from the service's camera."""

    def __init__(self) -> None:
        self.count = 0
        self.last_ns = HostNs(0)

    def add(self, now: HostNs) -> None:
        """Count a frame."""
        self.count, self.last_ns = self.count + 1, now


class ServiceParts(msgspec.Struct, frozen=True, kw_only=True, eq=False):
    """The parts of one run, one of each kind."""

    config: Config
    log: ServiceLog
    clock: HostClock
    calibrations: CalibrationStore
    kept: KeptCalibration | None
    """Result of self-calibration from an earlier run."""
    pipeline: Pipeline
    signing: SigningStore
    node: Node
    journal: Journal
    arrivals: ArrivalCount
    solver: BackgroundSolver | None
    """None where the smoother does not estimate."""


def make_parts(
    config: Config,
    calibration: Calibration | None,
    signing_key: bytes | None,
    *,
    elevation: Sequence[ElevationTile],
    extra_files: Mapping[str, bytes],
    attitudes_kept_s: float | None,
    solver: BackgroundSolver | None,
) -> ServiceParts:
    """The parts by the configuration and the files that it names."""
    log, clock = ServiceLog(config), HostClock()
    calibrations = CalibrationStore(config, warn)
    kept = calibrations.kept()
    pipeline = make_pipeline(
        config,
        calibration,
        unix_offset_ns=clock.unix_offset_ns,
        live=True,
        elevation=elevation,
        kept=kept,
        unit=board_name(),
        attitudes_kept_s=attitudes_kept_s,
        written=bool(config.record.directory),
        smoother=None if solver is None else SmootherOptions(solver),
    )
    signing = SigningStore(config, warn, wall_clock_is_synchronised)
    node = make_node(config, signing_key, signing.starting_timestamp(clock.started_unix_ns))
    pipeline.count_relayed(lambda: node.foreign_bytes)
    return ServiceParts(
        config=config,
        log=log,
        clock=clock,
        calibrations=calibrations,
        kept=kept,
        pipeline=pipeline,
        signing=signing,
        node=node,
        journal=Journal(make_recorder(config, extra_files, pipeline, warn), clock),
        arrivals=ArrivalCount(),
        solver=solver,
    )
