"""``fwav-companion detect``: runs the configured detector over recorded pictures."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec

from fwav_companion.cli.foreign_files import LARGE_HELP, foreign_files
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import ConfigError, InputFileError, UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Sequence

    from fwav_companion.config import Config
    from fwav_companion.tools.detect.recorded_pictures import PoseOptions, PoseRow, RecordedPictures
    from fwav_companion.vision.images import Detector, Found, Picture

STILL: Final = "still"
"""Value of --sigma for pictures without labels."""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "detect",
        description=(
            "Runs the detector of [vision] over recorded pictures and writes what it finds as `replay` reads it. Times "
            "are those of stamps.jsonl, of the pictures' EXIF (with its zone, else by GPS), or the video's own from "
            "--start on. Poses are those of the pictures' tags, or of the .SRT, .ASS, .csv or KLV of the video."
        ),
        epilog=(
            "examples:\n"
            "  fwav-companion detect flight.mp4 --start 2026-05-01T09:30:00+02:00 --config c.toml --out d.jsonl\n"
            "  fwav-companion replay --telemetry flight.tlog --detections d.jsonl --config c.toml --out t.jsonl"
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add(
        "pictures",
        metavar="PICTURES|VIDEO",
        type=Path,
        help="a folder of pictures, a recording with pictures, a picture, or a video",
    )
    add("--config", metavar="FILE", help="the configuration; its [vision] names the detector. Without: poses alone")
    add("--out", metavar="D.jsonl", type=Path, help="the detections, a line a picture")
    add(
        "--start",
        metavar="TIME",
        help="time of the first picture, ISO 8601 with a zone; needed for a video without UTC",
    )
    add("--poses-out", metavar="CSV", type=Path, help="the poses by the pictures' tags, or by the video's telemetry")
    add("--poses", metavar="FILE", type=Path, help="poses in place of the tags', as `locate --poses` reads them")
    add("--poses-crs", metavar="CRS", help="coordinate system of --poses where it names none, as EPSG:32632")
    add("--alt-datum", choices=("egm96", "ellipsoid", "takeoff"), help="what the pictures' altitudes count from")
    add("--takeoff-alt", metavar="M", type=float, help="altitude of the take-off above sea level, for --poses-out")
    add("--angles", metavar="ROLL,PITCH,YAW", help="of the camera, degrees, where tags or telemetry have none")
    add("--klv-time", choices=("auto", "utc", "misp"), default="auto", help="what the time of MISB metadata counts")
    add("--draw", metavar="DIR", type=Path, help="pictures with what was found drawn into them: look at some")
    add(
        "--sigma",
        metavar="LABELS|still",
        help="measure the accuracy of the boxes: COCO JSON or a folder of YOLO text files of these pictures; still: "
        "they are a video of standing things by a standing camera. Prints the lines for [vision]",
    )
    add("--large", action="store_true", help=LARGE_HELP)
    add("--json", action="store_true", help="end with the counts as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Detect in every picture; returns 0. UserError: the pictures, their times or the configuration are wrong."""
    with as_by_ctrl_c(), foreign_files("detect", large=arguments.large):
        return _detected(arguments)


def _detected(arguments: argparse.Namespace) -> int:
    writes_detections = any(each is not None for each in (arguments.out, arguments.draw, arguments.sigma))
    if arguments.config is None or (arguments.poses_out is not None and not writes_detections):
        return _poses_alone(arguments)
    if arguments.out is None and arguments.draw is None and arguments.sigma is None:
        raise UserError("detect: --config without --out; accepted: --out D.jsonl, --draw DIR or --sigma LABELS")
    require("detect", "numpy", "cv2")
    from fwav_companion.config import load
    from fwav_companion.tools.detect.recorded_pictures import parse_start, recorded_pictures

    config = load(arguments.config)
    outputs = _Outputs(arguments)
    detector = configured_detector(config, as_prior=outputs.measures)
    start = None if arguments.start is None else parse_start(arguments.start)
    timed = arguments.out is not None and arguments.poses_out is None  # with its own poses a picture needs no time
    if arguments.poses_out is not None or not _has_own_times(arguments.pictures):
        require("detect", "PIL")
    poses = None if arguments.poses_out is None else _pose_options(arguments)
    pictures = recorded_pictures(arguments.pictures, start, poses=poses, timed=timed)
    counts = _detect_all(outputs, pictures, detector)
    if arguments.poses_out is not None:
        _write_poses(arguments.poses_out, pictures.poses, arguments.pictures)
        counts["poses"] = len(pictures.poses)
    print(json.dumps(counts) if arguments.json else ", ".join(f"{number} {name}" for name, number in counts.items()))
    return 0


def _poses_alone(arguments: argparse.Namespace) -> int:
    """Write the poses of the pictures; needs no configuration, and no times."""
    if arguments.poses_out is None or arguments.out is not None:
        raise UserError("detect: no --config; accepted: --config FILE with --out, or --poses-out CSV alone")
    require("detect", "PIL", "cv2")
    from fwav_companion.cli.progress import steps
    from fwav_companion.tools.detect.recorded_pictures import parse_start, pose_rows

    start = None if arguments.start is None else parse_start(arguments.start)
    count, rows = pose_rows(arguments.pictures, start, _pose_options(arguments))
    poses = []
    with steps("poses", count) as step:
        for row in rows:
            if row is None:
                step()
            else:
                poses.append(row)
    _write_poses(arguments.poses_out, poses, arguments.pictures)
    counts = {"pictures": count, "poses": len(poses)}
    print(json.dumps(counts) if arguments.json else ", ".join(f"{number} {name}" for name, number in counts.items()))
    return 0


def _pose_options(arguments: argparse.Namespace) -> PoseOptions:
    from fwav_companion.cli.pose_options import given_angles, given_poses
    from fwav_companion.photographs.klv import TimeScale
    from fwav_companion.photographs.picture_pose import AltDatum
    from fwav_companion.tools.detect.recorded_pictures import PoseOptions, picture_files

    if arguments.takeoff_alt is not None and not -500.0 <= arguments.takeoff_alt <= 9000.0:
        raise UserError(f"--takeoff-alt {arguments.takeoff_alt:g}: accepted: -500 to 9000 metres above sea level")
    given = given_poses(arguments, lambda: picture_files(arguments.pictures))
    return PoseOptions(
        takeoff_alt_m=arguments.takeoff_alt,
        alt_datum=None if arguments.alt_datum is None else AltDatum(arguments.alt_datum),
        angles_deg=given_angles(arguments),
        table=None if given is None else given.poses,
        klv_time=TimeScale(arguments.klv_time),
    )


def _has_own_times(path: Path) -> bool:
    """Whether the path has times without EXIF: a folder with stamps, or a video."""
    from fwav_companion.tools.detect.recorded_pictures import SUFFIXES, folder_of
    from fwav_companion.vision.sources.folder import STAMPS_FILE

    return (folder_of(path) / STAMPS_FILE).is_file() or (path.is_file() and path.suffix.lower() not in SUFFIXES)


def configured_detector(config: Config, *, as_prior: bool = False) -> Detector:
    """The configured detector. ConfigError where there is none, or where it cannot work.

    ``as_prior``: with the prior sigma of a model's boxes, against which the true one is measured.
    """
    from fwav_companion.service.service_factory import make_vision_task
    from fwav_companion.vision.detectors import make_detector
    from fwav_companion.vision.images import DetectorError

    task = make_vision_task(config)
    if task is None:
        raise ConfigError(f'{config.file}: [vision]: missing; accepted: a table with detector = "apriltag" or another')
    if as_prior:
        if task.detector != "onnx":
            raise ConfigError(f'{config.file}: [vision] detector = "{task.detector}"; accepted with --sigma: "onnx"')
        task = msgspec.structs.replace(task, model_sigma="auto", model_bias=(0.0, 0.0))
    try:
        return make_detector(task, config.pad_tags)
    except DetectorError as error:
        raise ConfigError(f"{config.file}: {error}") from None


class _Outputs:
    """What is written of the detections: lines, pictures, and a measured sigma."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        """InputFileError where a folder or the labels cannot be used."""
        from fwav_companion.tools.detect.sigma_measurement import StandingResiduals, TruthFile, TruthResiduals

        self.out, self.draw = arguments.out, arguments.draw
        self.measures = arguments.sigma is not None
        self._truth = TruthFile(Path(arguments.sigma)) if self.measures and arguments.sigma != STILL else None
        self._against_truth, self._standing = TruthResiduals(), StandingResiduals()
        if self.draw is not None:
            try:
                self.draw.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputFileError(f"{self.draw}: {error.strerror}; accepted: a folder to write to") from None

    def add(self, picture: Picture, found: Sequence[Found], number: int) -> None:
        """Draw and measure the detections of a picture."""
        if self.draw is not None:
            from fwav_companion.vision.preview_drawing import drawn

            name = Path(picture.file).stem if picture.file else f"{number:06d}"
            (self.draw / f"{name}.jpg").write_bytes(drawn(picture.pixels, found))
        if not self.measures:
            return
        height, width = picture.pixels.shape[:2]
        if self._truth is None:
            self._standing.add(found, next(iter(picture.stamp.values())), (width, height))
        else:
            truth = self._truth.boxes(picture.file, (width, height))
            if truth is not None:
                self._against_truth.add(found, truth, (width, height))

    def report(self) -> dict[str, object]:
        """Print the measured accuracy with its lines for the configuration, and return it."""
        if not self.measures:
            return {}
        measured = self._standing.result() if self._truth is None else self._against_truth.result()
        print(f"# {measured.residuals} residuals: {measured.factor:.2f} times the prior's sigma")
        if measured.slow_factor is not None:
            print(f"# over a second: {measured.slow_factor:.2f} times; the larger one counts")
        if measured.lower_edge is not None:
            factor, down = measured.lower_edge
            print(f"# lower edge: {factor:.2f} times the centre's sigma, {100.0 * down:+.1f} % of the height (down: +)")
        print(f"[vision]\n{measured.lines()}")
        bias = {} if measured.bias is None else {"model_bias": measured.bias}
        edge = {} if measured.lower_edge is None else {"lower_edge": measured.lower_edge}
        return {"model_sigma": measured.model_sigma, "sigma_residuals": measured.residuals, **bias, **edge}


def _detect_all(outputs: _Outputs, pictures: RecordedPictures, detector: Detector) -> dict[str, object]:
    from fwav_companion.cli.progress import steps
    from fwav_companion.on_disk import whole
    from fwav_companion.vision.images import DetectorError, frame_bytes

    frames = detections = 0
    with ExitStack() as stack:
        file = None if outputs.out is None else stack.enter_context(whole(outputs.out))
        step = stack.enter_context(steps("detect", pictures.count))
        for picture in pictures.pictures:
            try:
                found = detector.detect(picture.pixels)
            except DetectorError as error:
                raise InputFileError(str(error)) from None
            if file is not None:
                file.write(frame_bytes(picture, found) + b"\n")
            outputs.add(picture, found, frames)
            frames, detections = frames + 1, detections + len(found)
            step()
    return {"frames": frames, "detections": detections, **outputs.report()}


def _write_poses(out: Path, poses: Sequence[PoseRow], pictures: Path) -> None:
    from fwav_companion.on_disk import whole

    if not poses:
        raise InputFileError(
            f"{pictures}: no picture has a pose; accepted: tags of DJI, Parrot, Autel, Skydio and others, --poses FILE "
            "or --angles ROLL,PITCH,YAW where only angles are missing"
        )
    from fwav_companion.photographs.poses_table import poses_csv

    with whole(out) as file:
        file.write(poses_csv(poses).encode())
