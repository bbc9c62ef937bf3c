"""The page of ``fwav-companion locate PICTURES --http HOST:PORT``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.http_address import http_address
from fwav_companion.errors import InputFileError, UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from fwav_companion.tools.locate.photographs import CameraOptions
    from fwav_companion.tools.locate.session import LocateOptions
    from fwav_companion.tools.locate_page.shelf import Shelf


def serve_page(arguments: argparse.Namespace, camera: CameraOptions, ground: LocateOptions) -> int:
    """Serve until a signal; returns 0. UserError: pictures, options or the file of clicks are wrong."""
    if arguments.pixel or arguments.detect or arguments.at or arguments.out is not None or arguments.json:
        raise UserError("locate --http: accepted: without --pixel, --at, --detect, --out and --json")
    require("locate --http", "aiohttp")
    import asyncio

    from fwav_companion import __version__
    from fwav_companion.ground.ground_process import access_rules
    from fwav_companion.ground.tiles import TileFile
    from fwav_companion.service.stop_signals import end_by
    from fwav_companion.tools.locate.session import LocateSession
    from fwav_companion.tools.locate_page.board import ClickBoard
    from fwav_companion.tools.locate_page.click_file import NAME, ClickFile
    from fwav_companion.tools.locate_page.page_server import LocateServer, LocateSettings

    address = http_address(arguments.http)
    shelf = _shelf(arguments.pictures, camera)
    first = arguments.pictures[0]
    file = ClickFile(arguments.pixels or (first if first.is_dir() else first.parent) / NAME)
    board = ClickBoard(file, shelf.photographs, lambda photographs: LocateSession(photographs, ground))
    board.state()  # what does not fit together is said before anybody opens the page
    tiles = None if arguments.tiles is None else TileFile(arguments.tiles)
    settings = LocateSettings(
        version=__version__, clicks=str(file.path), tiles=None if tiles is None else tiles.info, video_s=shelf.video_s
    )

    async def serve() -> None:
        stop = asyncio.Event()
        end_by(asyncio.get_running_loop(), stop.set)
        server = LocateServer(board, shelf, access_rules(address), settings, tiles)
        await server.start()
        try:
            print(f"pictures and map: {address.shown}   clicks are kept in {file.path}", flush=True)
            await stop.wait()
        finally:
            await server.close()

    asyncio.run(serve())
    return 0


def _shelf(given: list[Path], camera: CameraOptions) -> Shelf:
    from fwav_companion.cli.locate import is_video, pictures, read_with_progress
    from fwav_companion.tools.locate_page.shelf import PhotographShelf, VideoShelf

    if is_video(given):
        require("locate VIDEO", "cv2")
        (video,) = given
        if not video.is_file():
            raise InputFileError(f"{video}: no such file; accepted: a video")
        return VideoShelf(video, camera)
    return PhotographShelf(read_with_progress(pictures(given), camera))
