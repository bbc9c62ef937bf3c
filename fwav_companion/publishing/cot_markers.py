"""Which events are sent when: every confirmed track, the vehicle and its camera's view, at ``cot_rate_hz``. Pure.

The selected target keeps one uid through restarts; other tracks have theirs for one run. A confirmed track whose target
is out of sight stays on the map until it is stale: a found person must not vanish. Only a merged track is deleted.
"""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.publishing.cot import MapEvent, delete_event
from fwav_companion.publishing.cot_events import CameraAim, EventMaker, GeoidHeight, LookAt
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.types.messages import NoticeCode
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track, TrackState

MAX_MARKERS = 256
"""Most tracks that are remembered after their end; the oldest are forgotten, and stay on the map until stale."""
REPEAT_NS = 60 * NS_PER_S
"""Interval at which markers of ended tracks are repeated, for maps that connected later."""


class Marker(msgspec.Struct):
    """One track on the map."""

    track: Track
    event: MapEvent
    """The newest event under the track's own uid."""
    seen_utc_ns: int
    """UTC of the last fix."""
    own_shown: bool = False
    """Whether the map has a marker under the track's own uid."""
    sent_ns: HostNs = HostNs(0)


class MapMarkers:
    """Makes the events that are due."""

    def __init__(
        self, options: PublishOptions, look_at: LookAt | None = None, geoid: GeoidHeight | None = None
    ) -> None:
        self._options = options
        self._maker = EventMaker(options, geoid)
        self._look_at = look_at
        self._markers: dict[int, Marker] = {}
        self._merged: set[int] = set()
        self._selected: int | None = None
        self._run = ""

    def on_tracks(self, tracks: Iterable[Track]) -> None:
        """Note the tracks that were merged into another one."""
        for track in tracks:
            if track.state is TrackState.DROPPED and track.replaced_by is not None:
                self._merged.add(track.id)

    def due(self, tracks: Iterable[Track], selected: Track | None, situation: Situation) -> list[bytes] | NoticeCode:
        """The events of this instant, or why there are none. ``tracks``: the confirmed and coasting ones."""
        utc_ns = self._maker.utc_ns(situation)
        if isinstance(utc_ns, NoticeCode):
            return utc_ns
        self._run = self._run or f"{utc_ns // NS_PER_S:x}"
        events = [*self._view(situation, utc_ns), *self._deleted(utc_ns)]
        chosen = None if selected is None else selected.id
        live = set()
        for track in tracks:
            live.add(track.id)
            events += self._live(track, track.id == chosen, situation, utc_ns)
        events += self._return_of_own_marker(chosen, utc_ns)
        events += self._ended(live, chosen, situation.now_ns, utc_ns)
        return [event.as_xml().encode() for event in events]

    def _view(self, situation: Situation, utc_ns: int) -> list[MapEvent]:
        if not self._options.cot_vehicle:
            return []
        aim: CameraAim | None = None if self._look_at is None else self._look_at(situation.now_ns)
        vehicle = self._maker.vehicle(aim, situation, utc_ns)
        if vehicle is None:
            return []
        spi = self._maker.spi(aim, vehicle, situation)
        return [vehicle] if spi is None else [vehicle, spi]

    def _live(self, track: Track, is_selected: bool, situation: Situation, utc_ns: int) -> list[MapEvent]:
        prefix = self._maker.prefix(situation)
        event = self._maker.target(track, f"{prefix}.{self._run}.{track.id}", situation, utc_ns)
        if event is None:
            return []
        seen_utc_ns = utc_ns - max(0, situation.now_ns - track.last_seen_host_ns)
        marker = self._markers.setdefault(track.id, Marker(track, event, seen_utc_ns))
        marker.track, marker.event, marker.seen_utc_ns, marker.sent_ns = track, event, seen_utc_ns, situation.now_ns
        self._trim()
        if not is_selected:
            marker.own_shown = True
            return [event]
        named = self._options.cot_callsign or event.callsign
        events = [msgspec.structs.replace(event, uid=f"{prefix}.target", callsign=named)]
        if marker.own_shown:  # one target, one marker
            marker.own_shown = False
            events.append(delete_event(event, utc_ns))
        return events

    def _return_of_own_marker(self, chosen: int | None, utc_ns: int) -> list[MapEvent]:
        """The previously selected track under its own uid, once another one has taken the selected target's."""
        previous, marker = self._selected, self._markers.get(-1 if self._selected is None else self._selected)
        if chosen is None:
            return []  # the marker of the selected target stays where it was
        self._selected = chosen
        if previous == chosen or marker is None or marker.own_shown:
            return []
        marker.own_shown = True
        return [self._again(marker, utc_ns)]

    def _ended(self, live: set[int], chosen: int | None, now: HostNs, utc_ns: int) -> list[MapEvent]:
        """Repetitions of markers whose tracks ended; stale ones are forgotten."""
        events = []
        stale_ns = round(self._options.cot_target_stale_s * NS_PER_S)
        for number, marker in list(self._markers.items()):
            if number in live:
                continue
            if utc_ns >= marker.seen_utc_ns + stale_ns:
                del self._markers[number]
            elif marker.own_shown and number != chosen and now >= marker.sent_ns + REPEAT_NS:
                marker.sent_ns = now
                events.append(self._again(marker, utc_ns))
        return events

    def _deleted(self, utc_ns: int) -> list[MapEvent]:
        """Deletions of the markers of merged tracks."""
        events = []
        for number in self._merged:
            marker = self._markers.pop(number, None)
            if marker is not None and marker.own_shown:
                events.append(delete_event(marker.event, utc_ns))
        self._merged.clear()
        return events

    def _again(self, marker: Marker, utc_ns: int) -> MapEvent:
        """The last event of a track, with the time that is left of its validity."""
        left_s = self._options.cot_target_stale_s - (utc_ns - marker.seen_utc_ns) / NS_PER_S
        return msgspec.structs.replace(marker.event, utc_ns=utc_ns, stale_s=max(0.0, left_s))

    def _trim(self) -> None:
        while len(self._markers) > MAX_MARKERS:
            del self._markers[next(iter(self._markers))]
