"""``fwav-companion ground``: the ground picture on a web page."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fwav_companion.cli.http_address import http_address
from fwav_companion.errors import UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction

    from fwav_companion.ground.ground_process import GroundOptions

HTTP = "127.0.0.1:8080"
RATES_HZ = (1.0, 10.0)
EXAMPLES = """examples:
  the vehicle's companion, or a radio, sends to this laptop:
    fwav-companion ground --link udpin://0.0.0.0:14550
  a radio on USB, and a map without network:
    fwav-companion ground --link serial:///dev/ttyUSB0:57600 --tiles field.mbtiles
  for the phones of the field; the printed address has the token:
    fwav-companion ground --link udpin://0.0.0.0:14550 --http 0.0.0.0:8080
  three vehicles that look at the same ground, as one picture:
    fwav-companion ground --fleet survey --listen tcp/0.0.0.0:7447
  the same through a Zenoh router, as TLS in the file says:
    fwav-companion ground --fleet survey --connect tls/router.example.org:7447 --fleet-config zenoh.json5
  on the board, with all tracks and what `check` says:
    fwav-companion ground --status /run/fwav-companion/status.json
  the same from a laptop, where the board serves this file:
    fwav-companion ground --status http://192.168.1.20:8081/status.json --config fwav-companion.toml
  a recorded flight, ten times as fast:
    fwav-companion ground --replay targets.jsonl --speed 10"""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "ground",
        description="Listens as a ground station and serves a web page: vehicles and targets on a map, with the 95 % "
        "ellipses of the targets. The page only reads, and loads nothing from outside. Beyond loopback it requires the "
        "token of the printed address.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--link", metavar="URL", action="append", default=[], help="MAVLink, as in [[link]] url; may be repeated")
    add("--http", metavar="HOST:PORT", default=HTTP, help="where the page is served; default %(default)s")
    add("--tiles", metavar="FILE.mbtiles", help="map tiles; without them there is a grid with a scale")
    add("--fleet", metavar="NAME", help="fuse what the vehicles of this fleet see, over Zenoh")
    add(
        "--connect",
        metavar="ENDPOINT",
        action="append",
        default=[],
        help="Zenoh endpoint of a router or of a program that listens, as tcp/10.0.0.1:7447; may be repeated",
    )
    add(
        "--listen", metavar="ENDPOINT", action="append", default=[], help="Zenoh endpoint to listen on; may be repeated"
    )
    add("--scouting", action="store_true", help="find the fleet by multicast on the local network")
    add("--fleet-config", metavar="FILE", help="Zenoh configuration: TLS, access control")
    add("--cot", metavar="URL", action="append", default=[],
        help="send vehicles and targets as Cursor on Target, as udpout://239.2.3.1:6969 or tls://HOST:8089; may be "
        "repeated")  # fmt: skip
    add("--cot-client-cert", metavar="FILE", help="this machine's certificate for tls://, PEM or .p12")
    add("--cot-client-key", metavar="FILE", help="its private key, PEM")
    add("--cot-password-file", metavar="FILE", help="file with the password of the key or .p12")
    add("--cot-ca", metavar="FILE", help="authority of the server's certificate, PEM or .p12; default: the system's")
    add("--cot-server-name", metavar="NAME", help="name expected in the server's certificate; default: the host")
    add("--cot-package", metavar="FILE.zip", help="TAK data package in place of all of these")
    add("--foxglove", metavar="HOST:PORT", help="serve the picture to Foxglove and Lichtblick, as 127.0.0.1:8765; who "
        "can reach the port can read it")  # fmt: skip
    add("--status", metavar="FILE|URL", help="status of `run`: all its tracks, and what `check` says")
    add("--config", metavar="FILE", help="configuration of that `run`; for a URL, what `check` says needs it")
    add("--replay", metavar="T.jsonl", help="play a targets file, or a recording of --record")
    add("--speed", metavar="N", type=float, default=1.0, help="speed of --replay, 1 to 20; default %(default)g")
    add("--record", metavar="DIR", help="record the picture into this folder")
    add("--rate", metavar="HZ", type=float, default=5.0, help="updates of the page; 1 to 10, default %(default)g")
    add(
        "--hfov",
        metavar="DEG",
        type=float,
        help="horizontal field of view of cameras that do not report theirs: draws what they see, looking down",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Check the arguments, open the inputs, and serve until a signal."""
    require("ground", "aiohttp")
    import asyncio

    from fwav_companion.cli.ground_inputs import make_inputs
    from fwav_companion.ground.ground_process import GroundClock, GroundProcess
    from fwav_companion.ground.picture import GroundPicture
    from fwav_companion.ground.tiles import TileFile
    from fwav_companion.service.stop_signals import end_by

    options = _options(arguments)
    picture, clock = GroundPicture(), GroundClock()
    inputs, now = make_inputs(arguments, picture, clock.now)
    tiles = None if arguments.tiles is None else TileFile(arguments.tiles)
    process = GroundProcess(picture, inputs, options, clock=now, tiles=tiles, replays=arguments.replay is not None)

    async def serve() -> None:
        stop = asyncio.Event()
        end_by(asyncio.get_running_loop(), stop.set)
        await process.run(stop, lambda: print(f"ground picture: {options.shown}", flush=True))

    asyncio.run(serve())
    return 0


def _options(arguments: argparse.Namespace) -> GroundOptions:
    from fwav_companion.ground.ground_process import GroundOptions

    address = http_address(arguments.http)
    if not RATES_HZ[0] <= arguments.rate <= RATES_HZ[1]:
        raise UserError(f"--rate {arguments.rate:g}: accepted: {RATES_HZ[0]:g} to {RATES_HZ[1]:g}")
    if arguments.hfov is not None and not 1.0 <= arguments.hfov <= 180.0:
        raise UserError(f"--hfov {arguments.hfov:g}: accepted: 1 to 180, degrees")
    return GroundOptions(host=address.host, port=address.port, token=address.token, rate_hz=arguments.rate)
