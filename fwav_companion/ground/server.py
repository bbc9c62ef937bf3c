"""SHELL: the page over HTTP: files, events, history, exports, tiles. It only answers GET and changes nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib.resources import files

import msgspec
from aiohttp import web

from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.ground.access import SECURITY_HEADERS, AccessRules
from fwav_companion.ground.exports import cot_events, csv_table, geojson, kml, one_document
from fwav_companion.ground.guarded_site import GuardedSite, attached, json_response
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
EXPORTS = {
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
    "csv": "text/csv",
    "cot": "application/xml",
}
PAGE = files("fwav_companion.ground") / "page"
PAGE_FILES = frozenset(
    {
        "app.js", "connection.js", "details.js", "ellipse.js", "exports.js", "format.js", "graticule.js", "grids.js",
        "health.js", "icon.svg", "list.js", "map.js", "marks.js", "picture.js", "style.css", "units.js",
        "vendor/leaflet.css", "vendor/leaflet.js", "vendor/leaflet.LICENSE", "vendor/mgrs.js", "vendor/mgrs.LICENSE",
    }
)  # fmt: skip
"""Files that are served; no other file is."""


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
        self._picture, self._clock, self._period_s = picture, clock, 1.0 / rate_hz
        self._utc_ns, self._unit = utc_ns, unit
        self._site = GuardedSite(
            rules,
            index=PAGE / "index.html",
            page_files={name: PAGE.joinpath(name) for name in PAGE_FILES},
            settings=settings,
            tiles=tiles,
        )
        self._clients: set[web.StreamResponse] = set()
        self._encoder = msgspec.json.Encoder()
        self._encoded: dict[int, tuple[int, bytes]] = {}

    @property
    def clients(self) -> int:
        """Number of pages that get events."""
        return len(self._clients)

    async def start(self) -> None:
        """Listen. UserError where the address is taken or is not of this machine."""
        await self._site.start(
            {"/events": self._events, "/history.json": self._history, "/export/{kind}": self._export}
        )

    async def close(self) -> None:
        """End every connection."""
        await self._site.close()

    async def _history(self, request: web.Request) -> web.Response:
        return json_response(self._picture.history(request.query.get("target", "")))

    async def _export(self, request: web.Request) -> web.Response:
        kind = request.match_info["kind"]
        if kind not in EXPORTS:
            raise web.HTTPNotFound
        body = self._exported(kind)
        if body is None:
            return web.Response(status=503, text="UTC is unknown: synchronise this machine's clock (NTP)\n")
        return attached(body, EXPORTS[kind], f"targets.{'xml' if kind == 'cot' else kind}")

    def _exported(self, kind: str) -> bytes | None:
        targets, vehicles = self._picture.targets.values(), self._picture.vehicles.values()
        if kind == "geojson":
            return geojson(targets, vehicles)
        if kind == "kml":
            return kml(targets, vehicles)
        if kind == "csv":
            return csv_table(targets)
        utc_ns = self._utc_ns()
        if utc_ns is None:
            return None
        now_unix = self._clock()
        events = cot_events(targets, utc_ns, self._unit, vehicles=vehicles, geoid=geoid_undulation_m, now_unix=now_unix)
        return one_document(events)

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


def _event(name: str, data: bytes) -> bytes:
    return b"event: " + name.encode() + b"\ndata: " + data + b"\n\n"
