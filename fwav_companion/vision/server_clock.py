"""Maps a stream server's clock to this board's, from its stamps and their arrivals. PURE.

``host = server + offset + rate * (server - first server stamp)``. An arrival is late by the transport and by its
jitter, and never early, so the line lies below all differences ``arrival - stamp``. It is the edge of their lower
convex hull at the middle of the stamps, the line below them that is nearest to the mean (Zhang, Liu & Xia 2002).
Jitter and drift of the server's clock cancel. A constant latency stays in the offset.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from fwav_companion.geometry.hull import lower_hull

BUCKET_S = 1.0
"""Length of a bucket, seconds: only its least difference can touch the line."""
BUCKETS = 120
"""Number of buckets, two minutes: meanwhile a drift of 50 ppm changes by less than its noise, and the line follows a
warm-up of the crystal."""
LEAST_SPAN_S = 20.0
"""Least span of the stamps to estimate a rate, seconds: 5 ms of jitter are 250 ppm over 20 s, 5000 ppm over one."""
MOST_RATE = 5e-4
"""Largest rate, 500 ppm: crystals err by 100 at most; a steeper hull comes from a network whose delay changes."""
EARLY_S = 0.1
"""Lead of an arrival before the line, seconds, from which the server's clock was set: its errors are smaller."""
LATE_S, LATE_PICTURES = 1.0, 30
"""Delay, and number of pictures in a row with it, from which the server's clock was set back. A network that stalls
delivers again within a second."""

Difference = tuple[float, float]
"""Stamp of the server and arrival minus stamp, seconds."""


@dataclass
class ServerClock:
    """The estimate of one stream."""

    steps: int = 0
    """Number of times that the server's clock was set."""
    _least: list[Difference] = field(default_factory=list)
    """The least difference of each bucket, in the order of the stamps."""
    _line: tuple[float, float, float] | None = None
    """Stamp of a point on the line, difference at that stamp, and rate."""
    _late_count: int = 0

    def observe(self, server_s: float, arrival_s: float) -> bool:
        """Update with a picture's stamp and arrival; returns whether the server's clock was set since the last one."""
        difference_s = arrival_s - server_s
        stepped = self._is_stepped(server_s, difference_s)
        if stepped:
            self.steps += 1
            self._least, self._line, self._late_count = [], None, 0
        self._add(server_s, difference_s)
        return stepped

    def host_from_server(self, server_s: float) -> float:
        """The host instant of a server stamp, seconds; after the first picture."""
        if self._line is None:
            raise ValueError("no picture was observed")
        at_s, difference_s, rate = self._line
        return server_s + difference_s + rate * (server_s - at_s)

    @property
    def rate(self) -> float:
        """Rate of the difference host minus server, seconds per second; negative if the server's clock is fast."""
        return 0.0 if self._line is None else self._line[2]

    def _is_stepped(self, server_s: float, difference_s: float) -> bool:
        if self._line is None:
            return False
        late_s = difference_s - (self.host_from_server(server_s) - server_s)
        self._late_count = self._late_count + 1 if late_s > LATE_S else 0
        backwards = server_s < self._least[-1][0] - BUCKET_S
        return late_s < -EARLY_S - MOST_RATE * self._span_s() or self._late_count >= LATE_PICTURES or backwards

    def _add(self, server_s: float, difference_s: float) -> None:
        bucket = int(server_s // BUCKET_S)
        if self._least and int(self._least[-1][0] // BUCKET_S) >= bucket:
            if difference_s >= self._least[-1][1]:
                return
            self._least[-1] = (server_s, difference_s)
        else:
            self._least = [*self._least[-BUCKETS + 1 :], (server_s, difference_s)]
        self._line = self._fitted()

    def _span_s(self) -> float:
        return self._least[-1][0] - self._least[0][0]

    def _fitted(self) -> tuple[float, float, float]:
        lowest = min(self._least, key=lambda each: each[1])
        if self._span_s() < LEAST_SPAN_S:
            return (*lowest, 0.0)
        hull = lower_hull(self._least)
        middle_s = sum(at_s for at_s, _ in self._least) / len(self._least)
        (from_s, first_s), (to_s, last_s) = next((a, b) for a, b in pairwise(hull) if a[0] <= middle_s <= b[0])
        rate = (last_s - first_s) / (to_s - from_s)
        return (*lowest, 0.0) if abs(rate) > MOST_RATE else (from_s, first_s, rate)
