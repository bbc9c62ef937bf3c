"""Decides from message rates and the load of a link whether a frame may leave by it now.

Three limits work together; the lowest holds:

- a highest rate of a message: the configuration's ``max_rate_hz``, and caps of merged requests
  (:mod:`~fwav_companion.mavlink.router.station_rates`);
- ``max_bytes_per_s``, and the rate that a telemetry radio takes (:mod:`~fwav_companion.mavlink.router.byte_budget`).
  Once a second the load is measured, and fast telemetry streams are cut to one common rate at which all fit
  (:mod:`~fwav_companion.mavlink.router.link_load`);
- a token bucket between these measurements: over any time t at most ``t * rate + depth`` bytes of telemetry leave, so
 that the backlog of a line that drains faster is bounded.

Commands, their answers, parameters, missions and heartbeats always leave; telemetry makes room for them. A transfer of
hundreds of frames (a parameter list, a log) is queued (:mod:`~fwav_companion.mavlink.router.held_transfers`).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final

from fwav_companion.fair_queues import Origin
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.byte_budget import ByteBudget, RadioBackoff
from fwav_companion.mavlink.router.held_transfers import TRANSFERS, HeldTransfers
from fwav_companion.mavlink.router.link_load import LoadMeter, StreamKey, common_rate
from fwav_companion.mavlink.router.never_thinned import is_telemetry
from fwav_companion.mavlink.router.rate_limiter import RateLimiter
from fwav_companion.mavlink.router.station_rates import AskedRates, Cap, Why
from fwav_companion.mavlink.wire.definitions import BY_NAME, DEFINITIONS
from fwav_companion.types.network_status import LinkThinning, ThinnedMessage

FILLED: Final = 0.95
"""Share of the budget that measured streams are cut to: the rest is for bursts."""
LEAST_SHARE: Final = 0.05
"""Share of the budget that telemetry keeps in any case; PX4 keeps the same share (mavlink_main.cpp,
update_rate_mult)."""
STATIONS_SHARE: Final = 0.25
"""Share of the budget for what a station's link brings without a signature: a stranger there sends heartbeats and
commands, which are never thinned, ten times as fast as a radio takes them."""
TIMESYNC: Final = BY_NAME["TIMESYNC"].msgid
MAX_REASONS: Final = 256
"""Pairs of (message, reason) counted separately for the status."""
_UNLIMITED: Final = Cap(inf, Why.ASKED)


class LinkLimiter:
    """Rate and byte limiter of one link, in the direction out of this service."""

    def __init__(
        self, max_rate_hz: Mapping[str, float], *, max_bytes_per_s: float = 0.0, to_autopilot: bool = False
    ) -> None:
        """Start without caps. ``max_bytes_per_s``: 0 for no limit."""
        self._thinner = RateLimiter(max_rate_hz)
        self._max_bytes_per_s = max_bytes_per_s or None
        self._to_autopilot = to_autopilot
        self._caps: Mapping[int, Cap] = {}
        self._capped_sender = -1
        self._asked: AskedRates | None = None
        self._budget = ByteBudget()
        self._grant_budget = ByteBudget()
        self._radio = RadioBackoff()
        self._load = LoadMeter()
        self._common_hz = inf
        self._held = HeldTransfers()
        self._reasons: dict[tuple[int, Why], int] = {}
        self.thinned = 0
        """Frames that did not leave, since the start."""

    def merge(self, caps: Mapping[int, Cap], sender: int, asked: AskedRates) -> None:
        """Cap these messages of one sender (system << 8 | component). ``asked``: requests of the stations on the
        link.
        """
        self._caps, self._capped_sender, self._asked = caps, sender, asked

    def limits(self, msgid: int, sender: int) -> bool:
        """Return whether each frame of this message needs a decision of :meth:`passes`."""
        if self._counts_bytes or self._thinner.limits(msgid):
            return True
        return sender == self._capped_sender and msgid in self._caps

    def on_radio(self, txbuf: int, now: HostNs) -> bool:
        """Process a RADIO_STATUS of the radio behind this link. Returns True if the result of :meth:`limits` may have
        changed.
        """
        before = self._counts_bytes
        self._radio.on_report(txbuf, self._load.sent, self._load.offered, now)
        self._share()
        return before is not self._counts_bytes

    def passes(self, stream: StreamKey, size: int, now: HostNs) -> bool:
        """Return whether a frame of this size, bytes, may leave, and count it either way."""
        cap = self._cap(stream)
        if not self._counts_bytes or cap.hz <= 0.0:
            return (
                self._within(stream, cap, now) or self._is_awaited(stream, cap.why, now) or self._drop(stream, cap.why)
            )
        telemetry = is_telemetry(stream[0], to_autopilot=self._to_autopilot)
        self._measure(stream, size, cap.hz if telemetry else None, now)
        if telemetry and self._common_hz < cap.hz:
            cap = Cap(self._common_hz, self._budget_reason)
        thinned_by = self._thinned_by(stream, cap, telemetry, now)
        if thinned_by is not None and not self._is_awaited(stream, thinned_by, now):
            return self._drop(stream, thinned_by)
        self._budget.spend(size)
        self._load.leave(size)
        return True

    def grants(self, stream: StreamKey, size: int, share: float, now: HostNs) -> bool:
        """Return whether a frame that is not the vehicle's may leave if :meth:`passes` allows it, whatever its message:
        where bytes are limited, all of them together get ``share``.
        """
        limit = self._bytes_per_s
        if limit is not None:
            self._grant_budget.fill(share * limit, now)
            if not self._grant_budget.is_free:
                return self._drop(stream, self._budget_reason)
            self._grant_budget.spend(size)
        return True

    def _thinned_by(self, stream: StreamKey, cap: Cap, telemetry: bool, now: HostNs) -> Why | None:
        """Return why a frame may not leave a link whose bytes are counted; None if it may."""
        limit = self._bytes_per_s
        self._budget.fill(inf if limit is None else limit, now)
        if (telemetry or stream[0] not in DEFINITIONS) and not self._budget.is_free:
            # The bucket is checked before the stream's turn is used up: its next sample may leave instead.
            return self._budget_reason
        return None if self._within(stream, cap, now) else cap.why

    def refuse(self, stream: StreamKey, why: Why) -> None:
        """Count a frame of any kind that does not leave by this link."""
        self._drop(stream, why)

    def holds(self, msgid: int, data: bytes, origin: Origin, now: HostNs) -> bool:
        """Queue a transfer frame that is too fast for the link. Returns False if it is not held back."""
        limit = self._bytes_per_s
        return limit is not None and msgid in TRANSFERS and self._held.takes(data, origin, limit, now)

    @property
    def holds_any(self) -> bool:
        """Whether frames wait for :meth:`release`."""
        return bool(self._held)

    def release(self, now: HostNs) -> list[bytes]:
        """Return the queued frames that may leave now, and count them."""
        limit = self._bytes_per_s
        released = self._held.release(limit, now)
        for data in released:
            self._load.offer_other(len(data))
            self._load.leave(len(data))
            self._budget.fill(inf if limit is None else limit, now)
            self._budget.spend(len(data))
        return released

    def release_at(self, now: HostNs) -> HostNs:
        """Return the time at which :meth:`release` has a frame, while any frame waits."""
        return self._held.release_at(self._bytes_per_s, now)

    def disconnect(self) -> None:
        """Drop the queue of a link that went down: the next peer has no use for it."""
        self._held.clear()

    def status(self) -> LinkThinning:
        """Return the state for the status file."""
        limit = self._bytes_per_s
        return LinkThinning(
            messages=[
                self._row(msgid, why, count)
                for (msgid, why), count in self._reasons.items()
                if self._is_current(msgid, why)
            ],
            max_bytes_per_s=None if limit is None else round(limit, 1),
            why=None if limit is None else str(self._budget_reason),
            sent_bytes_per_s=None if self._load.sent is None else round(self._load.sent, 1),
            offered_bytes_per_s=None if self._load.sent is None else round(self._load.offered, 1),
            common_hz=None if self._common_hz == inf else round(self._common_hz, 2),
            txbuf=self._radio.txbuf,
        )

    @property
    def _counts_bytes(self) -> bool:
        return self._max_bytes_per_s is not None or self._radio.is_heard

    @property
    def _bytes_per_s(self) -> float | None:
        limits = [limit for limit in (self._max_bytes_per_s, self._radio.bytes_per_s) if limit is not None]
        return min(limits, default=None)

    @property
    def _budget_reason(self) -> Why:
        by_radio = self._radio.bytes_per_s
        return Why.RADIO if by_radio is not None and by_radio == self._bytes_per_s else Why.BYTES

    def _cap(self, stream: StreamKey) -> Cap:
        msgid, sender, _ = stream
        cap = self._caps.get(msgid, _UNLIMITED) if sender == self._capped_sender else _UNLIMITED
        configured_hz = self._thinner.max_rate_hz.get(msgid, inf)
        return Cap(configured_hz, Why.MAX_RATE) if configured_hz < cap.hz else cap

    def _within(self, stream: StreamKey, cap: Cap, now: HostNs) -> bool:
        return cap.hz == inf or self._thinner.passes(*stream, now, at_most_hz=cap.hz)

    def _is_awaited(self, stream: StreamKey, why: Why, now: HostNs) -> bool:
        """Return whether a station on this link requested one sample: it leaves unless ``max_rate_hz`` forbids it."""
        return why is not Why.MAX_RATE and self._asked is not None and self._asked.take_once(stream[0], now)

    def _measure(self, stream: StreamKey, size: int, cap_hz: float | None, now: HostNs) -> None:
        if cap_hz is None:
            self._load.offer_other(size)
        else:
            self._load.offer(stream, size, cap_hz)
        if self._load.roll(now):
            self._radio.expire(now)
            self._share()

    def _share(self) -> None:
        limit = self._bytes_per_s
        if limit is None:
            self._common_hz = inf
            return
        left = max(FILLED * limit - self._load.other, LEAST_SHARE * limit)
        self._common_hz = common_rate(self._load.streams, left)

    def _drop(self, stream: StreamKey, why: Why) -> bool:
        self.thinned += 1
        key = (stream[0], why)
        if key in self._reasons or len(self._reasons) < MAX_REASONS:
            self._reasons[key] = self._reasons.get(key, 0) + 1
        return False

    def _is_current(self, msgid: int, why: Why) -> bool:
        """Return whether the reason still holds: stations come and go."""
        cap = self._caps.get(msgid)
        return why in {Why.BYTES, Why.RADIO, Why.MAX_RATE} or msgid == TIMESYNC or (cap is not None and cap.why is why)

    def _row(self, msgid: int, why: Why, count: int) -> ThinnedMessage:
        name = DEFINITIONS[msgid].name if msgid in DEFINITIONS else "unknown"
        hz: float | None = self._common_hz if why in {Why.BYTES, Why.RADIO} else None
        if why is Why.MAX_RATE:
            hz = self._thinner.max_rate_hz.get(msgid)
        elif msgid in self._caps and self._caps[msgid].why is why:
            hz = self._caps[msgid].hz
        at_most_hz = None if hz is None or hz == inf else round(hz, 2)
        return ThinnedMessage(message=name, why=str(why), at_most_hz=at_most_hz, thinned=count)
