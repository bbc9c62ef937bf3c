"""``fwav-companion locate``: from a pixel in a picture to a place on the map."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fwav_companion.cli.foreign_files import LARGE_HELP, foreign_files
from fwav_companion.cli.pose_options import given_angles, given_poses, numbers, text_of
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import InputFileError, UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Callable, Sequence

    from fwav_companion.geometry.geoid_file import GtxGeoid
    from fwav_companion.tools.locate.answers import PlaceAnswers
    from fwav_companion.tools.locate.clicks import PictureClick
    from fwav_companion.tools.locate.photographs import CameraOptions, Photograph
    from fwav_companion.tools.locate.session import LocateOptions

EXIT_NO_PLACE = 1
MANY_PICTURES = 50
"""Pictures from which reading them shows its progress: half a second."""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "locate",
        description=(
            "Gives the place on the map of a pixel in a picture, with its 95 % ellipse and what limits it. Pose and "
            "lens are read from the picture's tags (DJI, Autel, Parrot, Skydio, Teal, senseFly and others). The same "
            "thing in several pictures gives one place, with a smaller ellipse. Pixels count as a viewer shows the "
            "picture; 0,0 is the middle of its top left pixel."
        ),
        epilog=(
            "examples:\n"
            "  fwav-companion locate DJI_0042.JPG --pixel 1912,1034\n"
            "  fwav-companion locate A.JPG B.JPG --pixel 1912,1034 --pixel 310,2200 --terrain N47E011.hgt --out x.kml\n"
            "  fwav-companion locate PICTURES/ --http 127.0.0.1:8090"
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("pictures", metavar="PICTURES|VIDEO", nargs="+", type=Path, help="pictures, folders of pictures, or a video")
    add("--pixel", metavar="U,V", action="append", default=[], help="of the thing, once a picture, in their order")
    add("--at", metavar="TIME", action="append", default=[], help="time in a video, as 00:01:23.4; one a --pixel")
    add("--pixels", metavar="FILE", type=Path, help="many: CSV with file, u, v, label, or gcp_list.txt")
    add(
        "--detect",
        action="store_true",
        help="the best detection of each label by the configured detector, in place of pixels",
    )
    add("--config", metavar="FILE", help="for --detect, and for [ground] terrain and [uncertainty] as written there")
    add("--label", metavar="NAME", default="target", help="name of the thing (default: target)")
    add("--camera", metavar="FILE", type=Path, help="a camera file in place of the lens by the tags")
    add("--hfov", metavar="DEG", type=float, help="horizontal field of view, where the tags have no lens")
    add("--angles", metavar="ROLL,PITCH,YAW", help="of the camera, degrees, where the tags have none; -90 looks down")
    add(
        "--poses",
        metavar="FILE",
        type=Path,
        help="poses in place of the tags': of OpenDroneMap, Pix4D, Metashape or COLMAP",
    )
    add("--poses-crs", metavar="CRS", help="coordinate system of --poses where it names none, as EPSG:32632")
    add("--terrain", metavar="FILE", nargs="+", type=Path, default=[], help="elevation files: .hgt, GeoTIFF")
    add("--geoid", metavar="FILE.gtx", type=Path, help="undulations of EGM2008, for --terrain above it")
    add("--ground-alt", metavar="M", type=float, help="flat ground at this altitude above sea level")
    add("--takeoff", metavar="LAT,LON", help="place of the take-off; its altitude is that of --terrain there")
    add("--takeoff-alt", metavar="M", type=float, help="altitude of the take-off above sea level")
    add("--alt-datum", choices=("egm96", "ellipsoid", "takeoff"), help="what the pictures' altitudes count from")
    add("--http", metavar="HOST:PORT", help="serve a page to click in the pictures beside a map, as 127.0.0.1:8090")
    add("--tiles", metavar="FILE.mbtiles", help="map tiles for --http; without them there is a grid with a scale")
    add("--out", metavar="FILE", type=Path, help="also write the places: .kml, .geojson or .csv")
    add("--large", action="store_true", help=LARGE_HELP)
    add("--json", action="store_true", help="end with the answer as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Locate; returns 0, or 1 where a pixel has no place. UserError: pictures or options are wrong."""
    with as_by_ctrl_c(), foreign_files("locate", large=arguments.large):
        return _located(arguments)


def _located(arguments: argparse.Namespace) -> int:
    require("locate", "numpy", "PIL")
    from fwav_companion.tools.locate.session import LocateSession, NoAnswer

    if arguments.http is not None:
        from fwav_companion.cli.locate_page import serve_page

        return serve_page(arguments, _camera_options(arguments), _ground_options(arguments))
    if is_video(arguments.pictures):
        photographs, clicks = _frames(arguments)
    elif arguments.detect:
        photographs = read_with_progress(pictures(arguments.pictures), _camera_options(arguments))
        clicks = _detections(arguments, photographs)
    else:
        paths = pictures(arguments.pictures)
        clicks = _clicks(arguments, [path.name for path in paths])
        wanted = {click.file for click in clicks}
        paths = [path for path in paths if path.name in wanted] or paths
        photographs = read_with_progress(paths, _camera_options(arguments))
    session = LocateSession(photographs, _ground_options(arguments))
    answers = session.located(clicks)
    if isinstance(answers, NoAnswer):
        print(answers.line, file=sys.stderr)
        if arguments.json:
            import json

            print(json.dumps({"targets": [], "file": answers.file, "reason": answers.reason}))
        return EXIT_NO_PLACE
    _print(answers)
    if arguments.out is not None:
        from fwav_companion.cli.output import written
        from fwav_companion.tools.locate.exports import exported

        content = exported(answers, arguments.out)
        with written(str(arguments.out)) as file:
            file.write(content)
    if arguments.json:
        import msgspec

        print(msgspec.json.encode(answers).decode())
    return 0


def read_with_progress(paths: Sequence[Path], options: CameraOptions) -> list[Photograph]:
    """The pictures, with a progress bar where there are many."""
    from fwav_companion.tools.locate.photographs import read_photographs

    if len(paths) < MANY_PICTURES:  # the bar's library takes longer to load than a few pictures
        return read_photographs(paths, options)
    from fwav_companion.cli.progress import steps

    with steps("pictures", len(paths)) as step:
        return read_photographs(paths, options, step=step)


def _print(answers: PlaceAnswers) -> None:
    from fwav_companion.tools.locate.answers import answer_lines, shared_line

    for answer in answers.targets:
        print("\n".join(answer_lines(answer)))
    for shared in answers.shared:
        print(shared_line(shared))
    for note in answers.assumed:
        print(note if note.startswith("WARNING") else f"assumed: {note}")
    if answers.contradiction:
        print(f"WARNING: {answers.contradiction}")
    if answers.unverified:
        print(f"NOTE: {answers.unverified}")


def is_video(given: Sequence[Path]) -> bool:
    """Whether one video is given in place of pictures."""
    from fwav_companion.tools.locate.videos import VIDEO_SUFFIXES

    return len(given) == 1 and given[0].suffix.lower() in VIDEO_SUFFIXES


def _frames(arguments: argparse.Namespace) -> tuple[list[Photograph], list[PictureClick]]:
    """The frames of a video at the times of --at, and the clicks in them."""
    require("locate VIDEO", "cv2")
    from fwav_companion.tools.locate.clicks import clicks_of, parse_pixel
    from fwav_companion.tools.locate.videos import frame_name, parse_time, video_frame, video_photographs

    (video,) = arguments.pictures
    if not video.is_file():
        raise InputFileError(f"{video}: no such file; accepted: a video")
    times = [parse_time(text) for text in arguments.at]
    if arguments.detect and times:
        photographs = video_photographs(video, times, _camera_options(arguments))
        return photographs, _detections(arguments, photographs, lambda index: video_frame(video, times[index]))
    if not times or len(times) != len(arguments.pixel):
        raise UserError(
            "locate VIDEO: accepted: --at TIME with --pixel U,V or --detect, as often as needed, in the same order"
        )
    names = [frame_name(video, time) for time in times]
    clicks = clicks_of(names, [parse_pixel(text) for text in arguments.pixel], arguments.label)
    return video_photographs(video, times, _camera_options(arguments)), clicks


def pictures(given: Sequence[Path]) -> list[Path]:
    """The pictures, also those of folders. InputFileError for what does not exist."""
    from fwav_companion.photographs.files import SUFFIXES

    found: list[Path] = []
    for path in given:
        if path.is_dir():
            inside = sorted(each for each in path.iterdir() if each.suffix.lower() in SUFFIXES)
            if not inside:
                raise InputFileError(f"{path}: no pictures in it; accepted: {', '.join(SUFFIXES)}")
            found += inside
        elif not path.exists():
            raise InputFileError(f"{path}: no such file; accepted: a picture, or a folder of pictures")
        else:
            found.append(path)
    return found


def _clicks(arguments: argparse.Namespace, names: Sequence[str]) -> list[PictureClick]:
    from fwav_companion.tools.locate.clicks import clicks_of, parse_clicks, parse_pixel

    if (arguments.pixels is None) == (not arguments.pixel):
        raise UserError("locate: accepted: one of --pixel U,V and --pixels FILE (see fwav-companion locate --help)")
    if arguments.pixels is None:
        return clicks_of(names, [parse_pixel(text) for text in arguments.pixel], arguments.label)
    return parse_clicks(text_of(arguments.pixels), str(arguments.pixels))


def _detections(
    arguments: argparse.Namespace, photographs: Sequence[Photograph], frame: Callable[[int], Any] | None = None
) -> list[PictureClick]:
    """The best detection of each label in each picture. UserError where there is none at all.

    ``frame``: returns the pixels of a picture that is a frame of a video, by its index.
    """
    if arguments.config is None or arguments.pixel or arguments.pixels is not None:
        raise UserError("locate --detect: accepted: with --config FILE, and without --pixel and --pixels")
    require("locate --detect", "cv2")
    from fwav_companion.cli.detect import configured_detector
    from fwav_companion.cli.progress import steps
    from fwav_companion.config import load
    from fwav_companion.tools.locate.detections import detected_clicks

    detector = configured_detector(load(arguments.config))
    clicks: list[PictureClick] = []
    with steps("detect", len(photographs)) as step:
        for index, photograph in enumerate(photographs):
            clicks += detected_clicks(photograph, detector, None if frame is None else frame(index))
            step()
    if not clicks:
        raise UserError("locate --detect: the detector finds nothing in these pictures; accepted: --pixel U,V")
    return clicks


def _geoid(path: Path) -> GtxGeoid:
    from fwav_companion.geometry.geoid_file import GtxGeoid
    from fwav_companion.on_disk import content

    try:
        return GtxGeoid(content(path))
    except ValueError as error:
        raise InputFileError(f"{path}: {error}") from None
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a .gtx file of a geoid") from None


def _camera_options(arguments: argparse.Namespace) -> CameraOptions:
    from fwav_companion.camera import file_and_camera, parse_calibration
    from fwav_companion.tools.locate.photographs import CameraOptions

    if arguments.hfov is not None and not 1.0 <= arguments.hfov <= 170.0:
        raise UserError(f"--hfov {arguments.hfov:g}: accepted: 1 to 170 degrees")
    calibration = None
    if arguments.camera is not None:
        file, camera = file_and_camera(str(arguments.camera))
        calibration = parse_calibration(text_of(Path(file)), file, camera=camera)
    given = given_poses(arguments, lambda: [] if is_video(arguments.pictures) else pictures(arguments.pictures))
    return CameraOptions(
        table=None if given is None else given.poses,
        lenses={} if given is None else given.lenses,
        calibration=calibration,
        hfov_deg=arguments.hfov,
        angles_deg=given_angles(arguments),
        mount_deg=_mount(arguments),
    )


def _mount(arguments: argparse.Namespace) -> tuple[float, float, float] | None:
    if arguments.config is None:
        return None
    from fwav_companion.config import load

    mount = load(arguments.config).camera.mount
    return (mount.roll_deg, mount.pitch_deg, mount.yaw_deg)


def _ground_options(arguments: argparse.Namespace) -> LocateOptions:
    from fwav_companion.photographs.picture_pose import AltDatum
    from fwav_companion.tools.locate.heights import VerticalOptions
    from fwav_companion.tools.locate.session import LocateOptions
    from fwav_companion.tools.locate.world import Configured, stated_uncertainty

    for name in ("ground_alt", "takeoff_alt"):
        value = getattr(arguments, name)
        if value is not None and not -500.0 <= value <= 9000.0:
            raise UserError(f"--{name.replace('_', '-')} {value:g}: accepted: -500 to 9000 metres above sea level")
    if arguments.terrain and arguments.ground_alt is not None:
        raise UserError("locate: --terrain and --ground-alt; accepted: one of them")
    terrain, datum, ground_alt, configured = tuple(arguments.terrain), "egm96", arguments.ground_alt, Configured()
    if arguments.config is not None:
        from fwav_companion.config import load

        config = load(arguments.config)
        configured = stated_uncertainty(text_of(Path(arguments.config)))
        datum = config.ground.terrain_datum or datum
        if config.ground.model == "terrain" and not terrain and ground_alt is None:
            terrain = tuple(config.resolve(path) for path in config.ground.terrain)
        if config.ground.model == "altitude" and not terrain and ground_alt is None:
            ground_alt = config.ground.alt_amsl
    takeoff = None if arguments.takeoff is None else numbers("--takeoff", arguments.takeoff, ("LAT", "LON"), 180.0)
    return LocateOptions(
        egm2008=None if arguments.geoid is None else _geoid(arguments.geoid),
        terrain=terrain,
        terrain_datum=datum,
        configured=configured,
        takeoff=None if takeoff is None else (takeoff[0], takeoff[1]),
        vertical=VerticalOptions(
            alt_datum=None if arguments.alt_datum is None else AltDatum(arguments.alt_datum),
            takeoff_alt_m=arguments.takeoff_alt,
            ground_alt_m=ground_alt,
        ),
    )
