"""SHELL: the page over HTTP: files, events, history, exports, tiles. It only answers GET and changes nothing."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from importlib.resources import files
from mimetypes import guess_type
from typing import TypeAlias

import msgspec
from aiohttp import web

from fwav_companion.errors import UserError
from fwav_companion.ground.access import COOKIE, SECURITY_HEADERS, AccessRules
from fwav_companion.ground.connections import QuietLog, WaitingConnections
from fwav_companion.ground.exports import cot_events, csv_table, geojson, kml, one_document
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.tiles import TileFile, TilesInfo

MAX_CLIENTS = 32
"""Most pages that get events at the same time; a further one is refused."""
SLOW_CLIENT_S = 20.0
"""Longest time to send one update, seconds; a slower client is disconnected, and reconnects by itself."""
KEEP_ALIVE_S = 1.0
"""Longest time between two updates, so that a page knows that the connection lives."""
RETRY_MS = 1000
"""Delay after which a page reconnects."""
MAX_REQUEST_BYTES = 4096
MAX_HEADER_BYTES = 8190
EXPORTS = {
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
    "csv": "text/csv",
    "cot": "application/xml",
}
PAGE = files("fwav_companion.ground") / "page"
PAGE_FILES = frozenset(
    {
        "app.js", "connection.js", "details.js", "ellipse.js", "format.js", "graticule.js", "icon.svg", "list.js",
        "map.js", "picture.js", "style.css", "vendor/leaflet.css", "vendor/leaflet.js", "vendor/leaflet.LICENSE",
        "vendor/mgrs.js", "vendor/mgrs.LICENSE",
    }
)  # fmt: skip
"""Files that are served; no other file is."""

Handler: TypeAlias = Callable[[web.Request], Awaitable[web.StreamResponse]]


class PageSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Settings that the page reads at its start."""

    version: str
    title: str
    tiles: TilesInfo | None
    replay: bool


class PageServer:
    """The HTTP server of one picture."""

    def __init__(
        self,
        picture: GroundPicture,
        rules: AccessRules,
        settings: PageSettings,
        *,
        clock: Callable[[], float],
        rate_hz: float,
        tiles: TileFile | None = None,
        utc_ns: Callable[[], int | None] = lambda: None,
        unit: str = "",
    ) -> None:
        """``clock``: Unix seconds of the picture. ``utc_ns``: UTC for Cursor on Target; None where it is unknown."""
        self._picture, self._rules, self._settings = picture, rules, settings
        self._clock, self._period_s = clock, 1.0 / rate_hz
        self._tiles, self._utc_ns, self._unit = tiles, utc_ns, unit
        self._clients: set[web.StreamResponse] = set()
        self._encoder = msgspec.json.Encoder()
        self._encoded: dict[int, tuple[int, bytes]] = {}
        self._runner: web.AppRunner | None = None
        self._waiting: WaitingConnections | None = None
        self._sweeping: asyncio.Task[None] | None = None

    @property
    def clients(self) -> int:
        """Number of pages that get events."""
        return len(self._clients)

    async def start(self) -> None:
        """Listen. UserError where the address is taken or is not of this machine."""
        application = web.Application(middlewares=[self._guarded], client_max_size=MAX_REQUEST_BYTES)
        application.router.add_get("/", self._index)
        application.router.add_get("/page/{name:.+}", self._file)
        application.router.add_get("/settings.json", self._settings_object)
        application.router.add_get("/events", self._events)
        application.router.add_get("/history.json", self._history)
        application.router.add_get("/export/{kind}", self._export)
        application.router.add_get("/tiles/{zoom:\\d+}/{column:\\d+}/{row:\\d+}", self._tile)
        self._runner = web.AppRunner(
            application, access_log=None, logger=QuietLog(logging.getLogger("fwav_companion.ground")),
            max_line_size=MAX_HEADER_BYTES, max_field_size=MAX_HEADER_BYTES, shutdown_timeout=0.5,
            handle_signals=False,
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
        if self._waiting is not None:
            self._waiting.on_request(request)
        token = request.query.get("token", "")
        refusal = self._rules.refusal(request.headers, token, request.cookies.get(COOKIE, ""))
        if refusal is not None:
            response: web.StreamResponse = web.Response(status=403, text=refusal + "\n")
        else:
            try:
                response = await handler(request)
            except web.HTTPException as error:
                response = web.Response(status=error.status, text=f"{error.reason}\n")
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    async def _index(self, request: web.Request) -> web.Response:
        response = web.Response(body=(PAGE / "index.html").read_bytes(), content_type="text/html", charset="utf-8")
        if self._rules.token and request.query.get("token"):
            response.set_cookie(COOKIE, self._rules.token, httponly=True, samesite="Strict")
        return response

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        if name not in PAGE_FILES:
            raise web.HTTPNotFound
        kind = "text/javascript" if name.endswith(".js") else guess_type(name)[0] or "text/plain"
        return web.Response(body=PAGE.joinpath(name).read_bytes(), content_type=kind, charset="utf-8")

    async def _settings_object(self, _request: web.Request) -> web.Response:
        return self._json(self._settings)

    async def _history(self, request: web.Request) -> web.Response:
        return self._json(self._picture.history(request.query.get("target", "")))

    async def _tile(self, request: web.Request) -> web.Response:
        place = [int(request.match_info[name][:9]) for name in ("zoom", "column", "row")]
        found = None if self._tiles is None else self._tiles.tile(*place)
        if found is None:
            raise web.HTTPNotFound
        return web.Response(body=found[1], content_type=found[0], headers={"Cache-Control": "max-age=3600"})

    async def _export(self, request: web.Request) -> web.Response:
        kind = request.match_info["kind"]
        if kind not in EXPORTS:
            raise web.HTTPNotFound
        body = self._exported(kind)
        if body is None:
            return web.Response(status=503, text="UTC is unknown: synchronise this machine's clock (NTP)\n")
        name = f'attachment; filename="targets.{"xml" if kind == "cot" else kind}"'
        return web.Response(body=body, content_type=EXPORTS[kind], headers={"Content-Disposition": name})

    def _exported(self, kind: str) -> bytes | None:
        targets, vehicles = self._picture.targets.values(), self._picture.vehicles.values()
        if kind == "geojson":
            return geojson(targets, vehicles)
        if kind == "kml":
            return kml(targets, vehicles)
        if kind == "csv":
            return csv_table(targets)
        utc_ns = self._utc_ns()
        return None if utc_ns is None else one_document(cot_events(targets, utc_ns, self._unit))

    async def _events(self, request: web.Request) -> web.StreamResponse:
        """Server-Sent Events: all paths, the whole picture, then its changes."""
        if len(self._clients) >= MAX_CLIENTS:
            return web.Response(status=503, text=f"{MAX_CLIENTS} pages are open: close one\n")
        response = web.StreamResponse(headers={**SECURITY_HEADERS, "Content-Type": "text/event-stream"})
        self._clients.add(response)
        try:
            await response.prepare(request)
            await self._send(response, f"retry: {RETRY_MS}\n\n".encode())
            await self._send(response, _event("paths", self._encoder.encode(self._picture.paths())))
            await self._follow(response)
        except (ConnectionError, TimeoutError):
            pass  # the page is gone; it comes back by itself
        finally:
            self._clients.discard(response)
        return response

    async def _follow(self, response: web.StreamResponse) -> None:
        """Send changes until the page is gone. A slow page skips states: there is no queue for it."""
        loop = asyncio.get_running_loop()
        revision, sent_s = 0, -KEEP_ALIVE_S
        while True:
            now_s = loop.time()
            if self._picture.revision != revision or now_s >= sent_s + KEEP_ALIVE_S:
                data = self._update_since(revision)
                revision, sent_s = self._picture.revision, now_s
                await self._send(response, data)
            await asyncio.sleep(self._period_s)

    def _update_since(self, revision: int) -> bytes:
        """The update as an event; pages at the same revision share one encoding."""
        current = self._picture.revision
        known = self._encoded.get(revision)
        if known is not None and known[0] == current and current != revision:
            return known[1]
        data = _event("picture", self._encoder.encode(self._picture.update_since(revision, self._clock())))
        if len(self._encoded) >= MAX_CLIENTS:
            self._encoded.clear()
        self._encoded[revision] = (current, data)
        return data

    async def _send(self, response: web.StreamResponse, data: bytes) -> None:
        async with asyncio.timeout(SLOW_CLIENT_S):
            await response.write(data)

    def _json(self, value: object) -> web.Response:
        return web.Response(body=self._encoder.encode(value), content_type="application/json")


def _event(name: str, data: bytes) -> bytes:
    return b"event: " + name.encode() + b"\ndata: " + data + b"\n\n"
