"""SHELL: the page of `locate` over HTTP: pictures, clicks and places, by the rules of the ground picture."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib.resources import files
from pathlib import PurePath
from typing import Final, ParamSpec, TypeVar

import msgspec
from aiohttp import web

from fwav_companion.errors import InputFileError
from fwav_companion.ground.access import AccessRules
from fwav_companion.ground.guarded_site import GuardedSite, attached, json_response
from fwav_companion.ground.server import PAGE as GROUND_PAGE
from fwav_companion.ground.tiles import TileFile, TilesInfo
from fwav_companion.tools.locate.exports import exported
from fwav_companion.tools.locate.session import REASONS
from fwav_companion.tools.locate_page.board import BoardState, ClickBoard
from fwav_companion.tools.locate_page.shelf import Shelf, shown

PAGE = files("fwav_companion.tools.locate_page") / "page"
OWN_FILES: Final = ("locate.css", "locate.js", "place_map.js", "picture_view.js", "scrubber.js", "target_list.js")
GROUND_FILES: Final = (
    "ellipse.js", "format.js", "graticule.js", "icon.svg", "style.css", "vendor/leaflet.css", "vendor/leaflet.js",
    "vendor/leaflet.LICENSE", "vendor/mgrs.js", "vendor/mgrs.LICENSE",
)  # fmt: skip
PAGE_FILES: Final = {
    **{name: PAGE.joinpath(name) for name in OWN_FILES},
    **{name: GROUND_PAGE.joinpath(name) for name in GROUND_FILES},
}
EXPORTS: Final = {
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
    "csv": "text/csv",
}
P = ParamSpec("P")
Asked = TypeVar("Asked", bound=msgspec.Struct)


class LocateSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Settings that the page reads at its start."""

    version: str
    clicks: str
    """Name of the file of the clicks."""
    tiles: TilesInfo | None
    video_s: float | None
    reasons: dict[str, str] = msgspec.field(default_factory=REASONS.copy)
    """Why a click has no place, in words."""


class ClickRequest(msgspec.Struct, forbid_unknown_fields=True):
    """A request to put a target into a picture."""

    file: str
    u: float
    v: float
    label: str


class RemoveRequest(msgspec.Struct, forbid_unknown_fields=True):
    """A request to remove a target's click, or all of its clicks."""

    label: str
    file: str | None = None


class RenameRequest(msgspec.Struct, forbid_unknown_fields=True):
    """A request to rename a target."""

    label: str
    new: str


class LocateServer:
    """The HTTP server of one board. Work on pictures is done in threads; clicks one after the other."""

    def __init__(
        self, board: ClickBoard, shelf: Shelf, rules: AccessRules, settings: LocateSettings, tiles: TileFile | None
    ) -> None:
        self._board, self._shelf = board, shelf
        self._turn = asyncio.Lock()
        self._site = GuardedSite(
            rules, index=PAGE / "index.html", page_files=PAGE_FILES, settings=settings, tiles=tiles
        )

    async def start(self) -> None:
        """Listen. UserError where the address is taken or is not of this machine."""
        get = {
            "/pictures.json": self._pictures,
            "/state.json": self._state,
            "/picture/{file}": self._picture,
            "/small/{file}": self._small,
            "/export/{kind}": self._export,
        }
        await self._site.start(get, {"/click": self._click, "/remove": self._remove, "/rename": self._rename})

    async def close(self) -> None:
        """End every connection."""
        await self._site.close()

    async def _pictures(self, _request: web.Request) -> web.Response:
        state = await self._asked()
        photographs = self._shelf.photographs([each.file for each in state.clicks])
        return json_response([shown(each) for each in photographs])

    async def _state(self, request: web.Request) -> web.Response:
        try:
            return json_response(await self._asked(*request.query.getall("show", [])[:1]))
        except InputFileError as error:
            return web.Response(status=400, text=f"{error}\n")

    async def _asked(self, *more: str) -> BoardState:
        async with self._turn:
            return await asyncio.to_thread(self._board.state, *more)

    async def _picture(self, request: web.Request) -> web.Response:
        return await self._image(request.match_info["file"], small=False)

    async def _small(self, request: web.Request) -> web.Response:
        return await self._image(request.match_info["file"], small=True)

    async def _image(self, file: str, *, small: bool) -> web.Response:
        try:
            kind, body = await asyncio.to_thread(self._shelf.image, file, small=small)
        except KeyError:
            raise web.HTTPNotFound from None
        except InputFileError as error:
            return web.Response(status=404, text=f"{error}\n")
        return web.Response(body=body, content_type=kind)

    async def _export(self, request: web.Request) -> web.Response:
        kind = request.match_info["kind"]
        if kind not in EXPORTS:
            raise web.HTTPNotFound
        state = await self._asked()
        return attached(exported(state.answers, PurePath(f"places.{kind}")), EXPORTS[kind], f"places.{kind}")

    async def _click(self, request: web.Request) -> web.Response:
        asked = await _body(request, ClickRequest)
        return await self._changed(self._board.click, asked.file, (asked.u, asked.v), asked.label)

    async def _remove(self, request: web.Request) -> web.Response:
        asked = await _body(request, RemoveRequest)
        return await self._changed(self._board.remove, asked.label, asked.file)

    async def _rename(self, request: web.Request) -> web.Response:
        asked = await _body(request, RenameRequest)
        return await self._changed(self._board.rename, asked.label, asked.new)

    async def _changed(self, change: Callable[P, None], *arguments: P.args, **named: P.kwargs) -> web.Response:
        """The state after a change, or why it was not made."""
        try:
            async with self._turn:
                await asyncio.to_thread(change, *arguments, **named)
                return json_response(await asyncio.to_thread(self._board.state))
        except InputFileError as error:
            return web.Response(status=400, text=f"{error}\n")


async def _body(request: web.Request, kind: type[Asked]) -> Asked:
    """The request's JSON. A form of another site cannot send this type of content without asking first."""
    if request.content_type != "application/json":
        raise web.HTTPUnsupportedMediaType
    try:
        return msgspec.json.decode(await request.read(), type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        raise web.HTTPBadRequest from None
