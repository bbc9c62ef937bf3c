"""SHELL: recorded flights in a folder, and the replay of one of them under one setting, on a worker."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot, sqrt
from pathlib import Path
from statistics import fmean, median
from typing import Final

import msgspec

from fwav_companion.config import load
from fwav_companion.errors import InputFileError, UserError
from fwav_companion.geometry.ellipses import semi_axes
from fwav_companion.on_disk import content
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.error_statistics import CHI2_95
from fwav_companion.recording.folder import DETECTIONS, TELEMETRY
from fwav_companion.recording.line_types import Line, TargetLine
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.recording.truth import TruthPoint, parse_truth
from fwav_companion.replay import TelemetryRead, join, replay
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.service.configured_files import load_calibration, load_elevation, recorded_configuration
from fwav_companion.tools.study.setting_record import SettingRecord

TRUTH: Final = "truth.csv"


def recorded_flights(folder: Path) -> list[str]:
    """The folders below this one that hold a recorded flight, by their paths from it. InputFileError without one."""
    if not folder.is_dir():
        raise InputFileError(f"{folder}: not a folder; accepted: a folder with recorded flights")
    found = sorted(
        str(path.parent.relative_to(folder)) for path in folder.rglob(TELEMETRY) if (path.parent / DETECTIONS).is_file()
    )
    if not found:
        raise InputFileError(
            f"{folder}: no recorded flight in it; accepted: folders with {TELEMETRY} and {DETECTIONS}, as `run` records"
        )
    return found


class RecordedWorker:
    """The flights and settings of a comparison. The newest flight's files are kept for its next setting."""

    def __init__(self, folder: str, config: str, settings: tuple[tuple[str, ...], ...]) -> None:
        """``config``: a configuration for all flights; empty: each flight's own."""
        self._folder, self._config = Path(folder), config
        self._settings = ((), *settings)
        self._read: tuple[str, TelemetryRead, bytes] | None = None

    def replayed(self, flight: str, setting: int) -> SettingRecord:
        """The measures of a flight under a setting. A damaged flight is a record that says so."""
        try:
            return self._measured(flight, setting)
        except UserError as error:
            return SettingRecord(flight=flight, setting=setting, damage=str(error))
        except (OSError, ValueError, ArithmeticError) as error:
            return SettingRecord(flight=flight, setting=setting, damage=f"{type(error).__name__}: {error}")

    def _measured(self, flight: str, setting: int) -> SettingRecord:
        folder = self._folder / flight
        name, camera = (self._config, list[str]()) if self._config else recorded_configuration(folder)
        config = load(name, [*camera, *self._settings[setting]])
        own = own_components(config)
        if self._read is None or self._read[0] != flight:
            self._read = (flight, load_telemetry(folder / TELEMETRY, own), content(folder / DETECTIONS))
        recording = join(self._read[1], self._read[2], own, config.vehicle.system_id)
        if not recording.messages:
            raise InputFileError(f"{folder / TELEMETRY}: no telemetry in it")
        truth = self._truth(folder)
        lines = replay(
            recording,
            config,
            load_calibration(config),
            elevation=load_elevation(config),
            sightings=True,
            truth=truth,
        )
        return measures_of(flight, setting, lines)

    def _truth(self, folder: Path) -> list[TruthPoint]:
        path = folder / TRUTH
        return parse_truth(content(path).decode(), str(path)) if path.is_file() else []


def measures_of(flight: str, setting: int, lines: Iterator[Line]) -> SettingRecord:
    """The measures from the lines of a replay with sightings."""
    squares, offsets, last = list[float](), list[float](), dict[int, float]()
    errors, unanswered = None, None
    for line in lines:
        if isinstance(line, TargetLine) and line.is_confirmed:
            last[line.track] = sqrt(CHI2_95) * semi_axes(line.cov)[0]
            if line.fix is not None:
                offsets.append(hypot(line.fix.north - line.north, line.fix.east - line.east) ** 2)
            if line.innovation is not None:
                squares.append(line.innovation.distance2)
        elif isinstance(line, SummaryLine):
            errors, unanswered = _errors_of(line)
    return SettingRecord(
        flight=flight,
        setting=setting,
        error_m=errors,
        radius95_m=median(last.values()) if last else None,
        scatter_m=sqrt(fmean(offsets)) if offsets else None,
        nis=fmean(squares) if squares else None,
        unanswered=unanswered,
    )


def _errors_of(summary: SummaryLine) -> tuple[float | None, float | None]:
    """Median final error, metres, and the share without an answer: of the true targets, else of the detections."""
    if summary.errors is not None:
        targets = summary.errors.targets
        found = [each.final_m for each in targets if each.final_m is not None]
        return median(found) if found else None, 1.0 - len(found) / len(targets)
    return None, 1.0 - summary.fixes / summary.detections if summary.detections else None


def replay_on_worker(worker: RecordedWorker, flight: str, setting: int) -> bytes:
    """One flight under one setting as a piece of work."""
    return msgspec.json.encode(worker.replayed(flight, setting))
