"""The clock between us and the autopilot: is it placed, and how well."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level

LONG_ROUND_TRIP_S: Final = 0.05
"""The bound on the clock is half of it: at 5 Hz and 5 deg of flapping 25 ms are 3 deg."""
POOR_SIGMA_S: Final = 0.005


def clock(evidence: Evidence) -> Iterator[Finding]:
    """All of it; nothing while there is no autopilot, which is told elsewhere."""
    if evidence.autopilot is None:
        return
    status, sigma_s = evidence.ask("clock", "status"), evidence.number("clock", "sigma_s")
    if status == "unknown":
        yield Finding(
            "no_clock", Level.STOPS, "clock", "nothing that the autopilot sends tells its time",
            "let it answer TIMESYNC (every ArduPilot and PX4 does), on a link that goes both ways: TX connected?",
        )  # fmt: skip
    elif status == "arrivals":
        yield Finding(
            "timesync_unanswered", Level.HARMS, "clock",
            "TIMESYNC is not answered: the clock comes from arrivals alone, late by the link's own delay",
            "see that what we send arrives there (on a wire our TX on its RX); with signing, that it has our key",
        )  # fmt: skip
    elif status == "settling" or sigma_s > POOR_SIGMA_S:
        yield Finding(
            "clock_unsettled", Level.HARMS, "clock", f"the clock is still settling: one sigma {1e3 * sigma_s:.1f} ms",
            "wait ten seconds and check again; if it stays so, the link's delay jumps: a wire instead of a radio",
        )  # fmt: skip
    round_trip_s = evidence.number("clock", "round_trip_s")
    if round_trip_s > LONG_ROUND_TRIP_S:
        yield Finding(
            "long_round_trip", Level.HARMS, "clock",
            f"the best round trip to the autopilot is {1e3 * round_trip_s:.0f} ms",
            "a faster or emptier link: half of it is the most that the clock can be off",
        )  # fmt: skip
