"""Reads all inputs of a replay before anything is written, and reports their damage."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from os.path import realpath
from pathlib import Path
from typing import TypedDict

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.cli.output import is_stdout
from fwav_companion.config import Config, load
from fwav_companion.errors import InputFileError
from fwav_companion.geoid import egm96
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import content
from fwav_companion.photographs.ground_control import control_points, is_ground_control
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.exports import Export, export_for
from fwav_companion.recording.line_types import Line
from fwav_companion.recording.photograph_poses import PosesFile, parse_poses
from fwav_companion.recording.summary_types import SharedErrorObject
from fwav_companion.recording.tlog import load_tlog
from fwav_companion.recording.truth import TruthPoint, parse_truth
from fwav_companion.replay import (
    Photographs,
    Recording,
    TelemetryRead,
    join,
    join_photographs,
    read_telemetry,
    replay,
    replay_photographs,
    require_photograph_config,
)
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.replay.user_filter import load_own_filter
from fwav_companion.service.configured_files import load_calibration, load_elevation
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.types import Sighting

MOST_TOLD = 10
"""Largest number of damaged places of one file that are reported individually."""


class ReplayOptions(TypedDict):
    """The optional arguments of a replay."""

    elevation: Sequence[ElevationTile]
    own_filter: Filter | None
    sightings: bool
    truth: Sequence[TruthPoint]


class ReplayInputs(msgspec.Struct, frozen=True, kw_only=True):
    """Inputs of a replay."""

    config: Config
    exports: Sequence[Export]
    calibration: Calibration
    truth: Sequence[TruthPoint]
    recording: Recording | Photographs
    elevation: Sequence[ElevationTile]
    own_filter: Filter | None

    def lines(self, *, sightings: bool) -> Iterator[Line]:
        """The lines of the requested replay."""
        return self._replay(self.config, own_filter=self.own_filter, sightings=sightings, truth=self.truth)

    def again(self, config: Config) -> Iterator[Line]:
        """The lines of a replay of the same recording with another configuration."""
        return self._replay(config)

    def _replay(
        self,
        config: Config,
        *,
        own_filter: Filter | None = None,
        sightings: bool = False,
        truth: Sequence[TruthPoint] = (),
    ) -> Iterator[Line]:
        options: ReplayOptions = {
            "elevation": self.elevation,
            "own_filter": own_filter,
            "sightings": sightings,
            "truth": truth,
        }
        if isinstance(self.recording, Photographs):
            return replay_photographs(
                self.recording, config, self.calibration, **options, shared_errors=self._shared_errors
            )
        return replay(self.recording, config, self.calibration, **options)

    def _shared_errors(
        self, sights: Mapping[int, Sequence[Sighting]], config: Config, downs: Sequence[float]
    ) -> list[SharedErrorObject]:
        from fwav_companion.tools.locate.replayed_sights import shared_errors

        return shared_errors(sights, self.calibration.lens, config, downs)


def read_replay_inputs(arguments: argparse.Namespace) -> ReplayInputs:
    """The inputs that the command line names. ConfigError or InputFileError for the first wrong one."""
    config = load(arguments.config, arguments.set)
    exports = [export_for(Path(name)) for name in arguments.export]
    _spare_what_is_read(arguments, config)
    calibration = load_calibration(config)
    truth = read_truth(arguments.truth)
    if arguments.poses is not None:
        require_photograph_config(config)
    recording = _recording(arguments, config)
    _require_a_frame(arguments, recording)
    _tell_damage(arguments, recording)
    return ReplayInputs(
        config=config,
        exports=exports,
        calibration=calibration,
        truth=truth,
        recording=recording,
        elevation=load_elevation(config),
        own_filter=load_own_filter(config, allow_code=arguments.allow_code, never_from=_recorded_files(arguments)),
    )


def _recorded_files(arguments: argparse.Namespace) -> list[Path]:
    return [Path(name) for name in (*(arguments.telemetry or ()), *(arguments.detections or ()))]


def _spare_what_is_read(arguments: argparse.Namespace, config: Config) -> None:
    """Check that no output would overwrite an input, or another output. InputFileError."""
    used = {Path(name): "--telemetry" for name in arguments.telemetry or ()}
    used |= {Path(name): "--detections" for name in arguments.detections}
    if arguments.poses is not None:
        used[Path(arguments.poses)] = "--poses"
    used |= {Path(arguments.config): "--config", config.calibration_path: "--config"}
    if arguments.truth is not None:
        used[Path(arguments.truth)] = "--truth"
    outputs = (arguments.out, *arguments.export)
    for name in (name for name in outputs if not is_stdout(name)):
        by = next((option for path, option in used.items() if _is_same(Path(name), path)), None)
        if by is not None:
            raise InputFileError(f"{name}: {by} names this file, which would be lost; accepted: another one")
        used[Path(name)] = "--out"


def _is_same(one: Path, other: Path) -> bool:
    if realpath(one) == realpath(other):
        return True
    try:
        return one.is_file() and other.is_file() and one.samefile(other)
    except OSError:  # a name that is too long is not a file
        return False


def _recording(arguments: argparse.Namespace, config: Config) -> Recording | Photographs:
    own = own_components(config)
    detections = b"\n".join(_content(name).removesuffix(b"\n") for name in arguments.detections)
    if arguments.poses is not None:
        return join_photographs(_poses(arguments.poses), detections)
    return join(_telemetry(arguments.telemetry, own), detections, own, config.vehicle.system_id)


def _poses(name: str) -> PosesFile:
    try:
        text = content(Path(name)).decode()
        return parse_poses(_as_poses_csv(text, name), name, _undulation_m)
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: a CSV file of poses") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{name}: byte {error.start} is not UTF-8; accepted: CSV") from None


def _as_poses_csv(text: str, name: str) -> str:
    """A photogrammetry program's table as a file of poses, by the reader of `locate` and `detect`; others as they are.

    InputFileError where it lacks what pictures' tags would give: `detect` joins both.
    """
    from fwav_companion.photographs.picture_pose import NoPose
    from fwav_companion.photographs.pose_tables import is_pose_table, parse_pose_table
    from fwav_companion.photographs.poses_table import pose_row, poses_csv
    from fwav_companion.photographs.table_poses import DATUM_NOTE, poses_of_table

    if not is_pose_table(text):
        return text
    rows = []
    for file, pose in poses_of_table(parse_pose_table(text, name), name, None).items():
        row = None if isinstance(pose, NoPose) else pose_row(file, pose, None)
        if row is None:
            raise InputFileError(
                f"{name}: {file}: no angles or no altitude in it; accepted: what `detect PICTURES --poses {name} "
                "--poses-out poses.csv` writes, with those of the pictures' tags"
            )
        rows.append(row)
    print(f"{name}: {DATUM_NOTE}", file=sys.stderr)
    return poses_csv(rows)


def _undulation_m(lat_deg: float, lon_deg: float) -> float:
    """EGM96, read for the first altitude above the ellipsoid."""
    return egm96().undulation_m(lat_deg, lon_deg)


def _require_a_frame(arguments: argparse.Namespace, recording: Recording | Photographs) -> None:
    """Reject a detections file none of whose lines is a frame; an empty one is a flight without a camera."""
    skipped = recording.skipped_lines
    if skipped and len(skipped) == len(recording.frames):
        damage = f"line {skipped[0].number} is not a frame ({skipped[0].why}), and no other line is"
        accepted = "accepted: detections, one JSON object per line"
        raise InputFileError(f"{' + '.join(arguments.detections)}: {damage}; {accepted}")


def _telemetry(names: Sequence[str], own: frozenset[int]) -> TelemetryRead:
    """The telemetry of one file of any kind, or of the parts of one .tlog in order."""
    if len(names) == 1:
        return load_telemetry(Path(names[0]), own)
    return read_telemetry(b"".join(load_tlog(Path(name)) for name in names))


def _tell_damage(arguments: argparse.Namespace, recording: Recording | Photographs) -> None:
    """Report the skipped damage with its offsets; several parts are counted as one file."""
    telemetry = arguments.poses or " + ".join(arguments.telemetry)
    detections = " + ".join(arguments.detections)
    if not recording.frames:
        print(f"{detections}: no frame in it", file=sys.stderr)
    for note in recording.notes:
        print(f"{telemetry}: {note}", file=sys.stderr)
    for note in recording.detection_notes if isinstance(recording, Recording) else ():
        print(f"{detections}: {note}", file=sys.stderr)
    _tell_first(
        f"{telemetry}: skipped {skipped.length} damaged bytes at offset {skipped.offset}"
        for skipped in (recording.skipped if isinstance(recording, Recording) else ())
    )
    _tell_first(
        f"{detections}: line {skipped.number} at offset {skipped.offset} is not a frame: {skipped.why}"
        for skipped in recording.skipped_lines
    )


def _tell_first(complaints: Iterable[str]) -> None:
    complaints = list(complaints)
    for complaint in complaints[:MOST_TOLD]:
        print(complaint, file=sys.stderr)
    if len(complaints) > MOST_TOLD:
        print(f"  and {len(complaints) - MOST_TOLD} more such places", file=sys.stderr)


def _content(name: str) -> bytes:
    try:
        return content(Path(name))
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: detections, one JSON object per line") from None


def read_truth(name: str | None) -> list[TruthPoint]:
    """The points of a truth file, or of ground control above sea level; empty without a name. InputFileError."""
    if name is None:
        return []
    try:
        text = content(Path(name)).decode()
        if is_ground_control(text):
            points = control_points(text, name)
            return [TruthPoint(label, Geodetic.from_degrees(*place), None, None) for label, place in points.items()]
        return parse_truth(text, name)
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: a truth file: CSV, JSONL or gcp_list.txt") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{name}: byte {error.start} is not UTF-8; accepted: CSV or JSONL") from None
