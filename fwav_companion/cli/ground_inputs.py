"""The inputs of ``ground`` by its arguments, and the findings of `check` for a status."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from fwav_companion.errors import UserError
from fwav_companion.fleet.options import FLEET_NAME
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from fwav_companion.config import Config
    from fwav_companion.ground.ground_process import PictureInput
    from fwav_companion.ground.picture import GroundPicture
    from fwav_companion.tools.doctor.finding import Finding
    from fwav_companion.types.status import RunStatus

Url = TypeVar("Url")
WITHOUT_CONFIG = "NOTE: what `check` says needs --config FILE, a copy of that service's configuration"
SPEEDS = (1.0, 20.0)
COT_FILES = ("client_cert", "client_key", "password_file", "ca", "server_name", "package")
"""Flags of `ground` after --cot-, as the keys of [publish]."""


def make_inputs(
    arguments: argparse.Namespace, picture: GroundPicture, clock: Callable[[], float]
) -> tuple[list[PictureInput], Callable[[], float]]:
    """The inputs, and the clock of the picture: that of this process, or of the replayed recording."""
    if arguments.replay is not None:
        return _replayed(arguments, picture)
    inputs: list[PictureInput] = []
    if arguments.link:
        from fwav_companion.ground.station import PictureStation
        from fwav_companion.links.url import parse_link_url

        urls = [_parsed("--link", text, parse_link_url) for text in arguments.link]
        inputs.append(PictureStation(urls, picture, clock=clock, hfov_deg=arguments.hfov))
    if arguments.status is not None:
        from fwav_companion.ground.status_reader import StatusReader
        from fwav_companion.tools.doctor.run_status import run_status

        judge = _judge(arguments.status, arguments.config)
        inputs.append(StatusReader(arguments.status, picture, clock=clock, understand=run_status, judge=judge))
    elif arguments.config is not None:
        raise UserError("--config: accepted: with --status, the configuration of that service")
    if arguments.fleet is not None:
        inputs.append(_fleet(arguments, picture, clock))
    if not inputs:
        accepted = "--link URL, as --link udpin://0.0.0.0:14550, --fleet NAME, --status or --replay"
        raise UserError(f"ground: no input; accepted: {accepted}")
    inputs += _map_outputs(arguments, picture)
    if arguments.foxglove is not None:
        inputs.append(_viewer_output(arguments.foxglove, picture))
    if arguments.record is not None:
        from fwav_companion.ground.picture_recorder import PictureRecorder

        inputs.append(PictureRecorder(arguments.record, picture, clock()))
    return inputs, clock


def _parsed(option: str, text: str, parse: Callable[[str], Url]) -> Url:
    """The URL of an option. UserError that names the option and the text."""
    try:
        return parse(text)
    except UserError as error:
        raise UserError(f"{option} {text}: {error}") from None


def _map_outputs(arguments: argparse.Namespace, picture: GroundPicture) -> list[PictureInput]:
    """The senders of Cursor on Target: one an address, and one for a package without an address."""
    files = {name: getattr(arguments, f"cot_{name}") or "" for name in COT_FILES}
    urls = arguments.cot or ([""] if files["package"] else [])
    if not urls:
        given = next((name for name, value in files.items() if value), None)
        if given is not None:
            raise UserError(f"--cot-{given.replace('_', '-')} without --cot: accepted: with --cot tls://HOST:8089")
        return []
    from fwav_companion.ground.ground_process import utc_ns
    from fwav_companion.ground.map_output import MapOutput
    from fwav_companion.links.map_server import MapServer
    from fwav_companion.links.url import parse_cot_url
    from fwav_companion.service.board import board_name

    for url in urls:
        if url:
            _parsed("--cot", url, parse_cot_url)
    return [MapOutput(MapServer(url=url, **files), picture, utc_ns, board_name()) for url in urls]


def _viewer_output(address: str, picture: GroundPicture) -> PictureInput:
    """The server for Foxglove and Lichtblick."""
    require("--foxglove", "foxglove")
    from fwav_companion.ground.viewer_output import ViewerOutput

    host, separator, port = address.rpartition(":")
    if not separator or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise UserError(f"--foxglove {address}: accepted: HOST:PORT, as 127.0.0.1:8765")
    return ViewerOutput(host.strip("[]"), int(port), picture)


def _fleet(arguments: argparse.Namespace, picture: GroundPicture, clock: Callable[[], float]) -> PictureInput:
    require("--fleet", "zenoh", "numpy")
    from fwav_companion.fleet.bus import BusPlace
    from fwav_companion.ground.fleet_input import FleetInput

    if re.fullmatch(FLEET_NAME, arguments.fleet) is None:
        raise UserError(f"--fleet {arguments.fleet}: accepted: letters, digits, _ . -")
    place = BusPlace(
        arguments.fleet,
        connect=arguments.connect,
        listen=arguments.listen,
        scouting=arguments.scouting,
        config=arguments.fleet_config or "",
    )
    return FleetInput(place, picture, clock=clock)


def _replayed(arguments: argparse.Namespace, picture: GroundPicture) -> tuple[list[PictureInput], Callable[[], float]]:
    from fwav_companion.ground.replay_reader import ReplayReader

    others = [
        name
        for name in ("link", "status", "record", "fleet", "cot", "cot_package", "foxglove")
        if getattr(arguments, name)
    ]
    if others:
        raise UserError(f"--replay with --{others[0]}: accepted: --replay alone, its time is another")
    if not SPEEDS[0] <= arguments.speed <= SPEEDS[1]:
        raise UserError(f"--speed {arguments.speed:g}: accepted: {SPEEDS[0]:g} to {SPEEDS[1]:g}")
    reader = ReplayReader(arguments.replay, picture, arguments.speed)
    return [reader], reader.now


def _judge(where: str, config_file: str | None) -> Callable[[RunStatus], tuple[str, ...]]:
    """Function for the findings: on this board also by its files, elsewhere by the status and a configuration."""
    is_elsewhere = where.startswith(("http://", "https://"))
    if config_file is not None:
        from fwav_companion.config import load

        return partial(judged_elsewhere if is_elsewhere else judged_here, load(config_file))
    if is_elsewhere:
        return lambda _status: (WITHOUT_CONFIG,)
    return findings_by_status


def findings_by_status(status: RunStatus) -> tuple[str, ...]:
    """Findings of `check` for the service on this board; one line if its configuration cannot be read here."""
    from fwav_companion.config import load

    try:
        return judged_here(load(status.config_path), status)
    except (UserError, OSError, ValueError):  # ValueError: a path of bytes that no path has
        return ("check: its configuration cannot be read here",)


def judged_here(config: Config, status: RunStatus) -> tuple[str, ...]:
    """Findings of `check` for the service on this board."""
    from fwav_companion.tools.doctor.board import Probe
    from fwav_companion.tools.doctor.evidence import Evidence
    from fwav_companion.tools.doctor.examination import examine
    from fwav_companion.tools.doctor.gathering import load_files

    files, _ = load_files(config)
    unopened = {name: link.why for name, link in status.links.items() if link.state == "down"}
    board = Probe().board(config, unopened | {"detections": status.intake.why})
    return _lines(examine(Evidence(config=config, board=board, files=files, status=status)))


def judged_elsewhere(config: Config, status: RunStatus) -> tuple[str, ...]:
    """Findings of `check` for a service on another machine, by its status alone."""
    from fwav_companion.tools.doctor.evidence import Board, Evidence
    from fwav_companion.tools.doctor.examination import examine
    from fwav_companion.tools.doctor.gathering import load_files

    files, _ = load_files(config)
    said = _lines(examine(Evidence(config=config, board=Board(), files=files, status=status), elsewhere=True))
    if files.calibration_error:
        said += (f"NOTE: {files.calibration_error}. What `check` says of the camera is left out",)
    return said


def _lines(findings: Sequence[Finding]) -> tuple[str, ...]:
    from fwav_companion.tools.doctor.finding import by_level

    return tuple(f"{finding.level}: {finding.problem}. {finding.fix}" for finding in by_level(findings))
