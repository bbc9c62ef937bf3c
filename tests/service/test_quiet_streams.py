"""The timer rings for undecided bytes of a stream, also when no readable message arrives."""

from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.mavlink.router.node import QUIET_NS
from fwav_companion.service.daemon import Service

OF_AN_UNKNOWN_ID = bytes.fromhex("fd 03 00 00 07 09 01 40 42 0f 01 02 03 00 00")


class Armed:
    """A timer that only records the deadline of work that no message triggers."""

    def __init__(self) -> None:
        self.strict_after_ms: list[float] = []

    def arm(self, now: int, _due: int | None, strict: int | None) -> None:
        if strict is not None:
            self.strict_after_ms.append((strict - now) / NS_PER_MS)


def test_a_frame_of_an_unknown_id_waits_for_no_other(service: Service):
    """It is relayed once its stream has been quiet; before this rule it waited for our next heartbeat."""
    service._dispatcher._alarm = armed = Armed()
    service._dispatcher.on_bytes("autopilot", OF_AN_UNKNOWN_ID)
    assert armed.strict_after_ms == [QUIET_NS / NS_PER_MS]
