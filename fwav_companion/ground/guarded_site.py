"""SHELL: a local site over HTTP: who is answered, its page's files, its settings, its map tiles."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from importlib.resources.abc import Traversable
from mimetypes import guess_type
from typing import TypeAlias

import msgspec
from aiohttp import web

from fwav_companion.blocking import in_daemon_thread
from fwav_companion.errors import UserError
from fwav_companion.ground.access import COOKIE, SECURITY_HEADERS, AccessRules
from fwav_companion.ground.connections import QuietLog, WaitingConnections
from fwav_companion.ground.tiles import TileFile

MAX_REQUEST_BYTES = 4096
MAX_HEADER_BYTES = 8190
IDLE_S = 15.0
"""Longest time for which an answered connection waits for its next request, seconds. The library's default is an hour:
strangers could hold as many connections as this process may open files."""

Handler: TypeAlias = Callable[[web.Request], Awaitable[web.StreamResponse]]


class GuardedSite:
    """The part of a page's server that does not depend on what the page shows."""

    def __init__(
        self,
        rules: AccessRules,
        *,
        index: Traversable,
        page_files: Mapping[str, Traversable],
        settings: msgspec.Struct,
        tiles: TileFile | None = None,
    ) -> None:
        """``page_files``: files below /page/ by name; no other file is served. ``settings``: what the page reads."""
        self._rules, self._index_file, self._page_files = rules, index, page_files
        self._settings, self._tiles = settings, tiles
        self._tile_turn = asyncio.Lock()
        self._runner: web.AppRunner | None = None
        self._waiting: WaitingConnections | None = None
        self._sweeping: asyncio.Task[None] | None = None

    async def start(self, get: Mapping[str, Handler], post: Mapping[str, Handler] | None = None) -> None:
        """Listen, with the page's own requests by path. UserError where the address is taken or not of this machine."""
        application = web.Application(middlewares=[self._guarded], client_max_size=MAX_REQUEST_BYTES)
        application.router.add_get("/", self._index)
        application.router.add_get("/page/{name:.+}", self._file)
        application.router.add_get("/settings.json", self._settings_object)
        application.router.add_get("/tiles/{zoom:\\d+}/{column:\\d+}/{row:\\d+}", self._tile)
        for path, handler in get.items():
            application.router.add_get(path, handler)
        for path, handler in (post or {}).items():
            application.router.add_post(path, handler)
        self._runner = web.AppRunner(
            application, access_log=None, logger=QuietLog(logging.getLogger("fwav_companion.ground")),
            max_line_size=MAX_HEADER_BYTES, max_field_size=MAX_HEADER_BYTES, keepalive_timeout=IDLE_S,
            shutdown_timeout=0.5, handle_signals=False,
        )  # fmt: skip
        await self._runner.setup()
        try:
            await web.TCPSite(self._runner, self._rules.host, self._rules.port).start()
        except OSError as error:
            where = f"--http {self._rules.host}:{self._rules.port}"
            raise UserError(f"{where}: {error.strerror}; accepted: a free port of this machine") from None
        if self._runner.server is not None:
            self._waiting = WaitingConnections(self._runner.server, time.monotonic)
            self._sweeping = asyncio.create_task(self._waiting.keep_sweeping(), name="waiting connections")

    async def close(self) -> None:
        """End every connection."""
        if self._sweeping is not None:
            self._sweeping.cancel()
        if self._runner is not None:
            await self._runner.cleanup()

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer, or refuse by the access rules; every answer has the security headers."""
        token = request.query.get("token", "")
        refusal = self._rules.refusal(request.headers, token, request.cookies.get(COOKIE, ""))
        if refusal is not None:
            response: web.StreamResponse = web.Response(status=403, text=refusal + "\n")
            response.force_close()  # a stranger keeps no connection
        else:
            if self._waiting is not None:
                self._waiting.on_request(request)
            try:
                response = await handler(request)
            except web.HTTPException as error:
                response = web.Response(status=error.status, text=f"{error.reason}\n")
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    async def _index(self, request: web.Request) -> web.Response:
        response = web.Response(body=self._index_file.read_bytes(), content_type="text/html", charset="utf-8")
        if self._rules.token and request.query.get("token"):
            response.set_cookie(COOKIE, self._rules.token, httponly=True, samesite="Strict")
        return response

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        if name not in self._page_files:
            raise web.HTTPNotFound
        kind = "text/javascript" if name.endswith(".js") else guess_type(name)[0] or "text/plain"
        return web.Response(body=self._page_files[name].read_bytes(), content_type=kind, charset="utf-8")

    async def _settings_object(self, _request: web.Request) -> web.Response:
        return json_response(self._settings)

    async def _tile(self, request: web.Request) -> web.Response:
        place = [int(request.match_info[name][:9]) for name in ("zoom", "column", "row")]
        found = None if self._tiles is None else await self._found(self._tiles, place)
        if found is None:
            raise web.HTTPNotFound
        return web.Response(body=found[1], content_type=found[0], headers={"Cache-Control": "max-age=3600"})

    async def _found(self, tiles: TileFile, place: Sequence[int]) -> tuple[str, bytes] | None:
        """Look one tile up beside the loop: a file may make a query last for seconds."""
        async with self._tile_turn:
            return await in_daemon_thread(partial(tiles.tile, *place), name="map tile")


def json_response(value: object) -> web.Response:
    """A value as JSON."""
    return web.Response(body=msgspec.json.encode(value), content_type="application/json")


def attached(body: bytes, kind: str, name: str) -> web.Response:
    """A file to download."""
    return web.Response(body=body, content_type=kind, headers={"Content-Disposition": f'attachment; filename="{name}"'})
