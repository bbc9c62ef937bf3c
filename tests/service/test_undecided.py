"""What a stream leaves undecided is rung for, also where nothing came that anybody here reads."""

from pathlib import Path

from fwav_companion.config import load
from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.mavlink.node import QUIET_NS
from fwav_companion.service.daemon import Service

LINKS = """
[[link]]
name = "autopilot"
url = "tcpin://127.0.0.1:5760"
role = "autopilot"
[[link]]
name = "ground"
url = "udpout://127.0.0.1:14550"
role = "gcs"
[detections]
url = ""
"""
OF_AN_UNKNOWN_ID = bytes.fromhex("fd 03 00 00 07 09 01 40 42 0f 01 02 03 00 00")


class Armed:
    """An alarm that only remembers by when it is to ring for what nobody else does."""

    def __init__(self) -> None:
        self.strict_after_ms: list[float] = []

    def arm(self, now: int, _due: int | None, strict: int | None) -> None:
        if strict is not None:
            self.strict_after_ms.append((strict - now) / NS_PER_MS)


def test_a_frame_of_an_unknown_id_waits_for_no_other(tmp_path: Path):
    """It is relayed once its stream has been quiet; until then it waited for the next heartbeat of ours."""
    config = tmp_path / "relay.toml"
    config.write_text(LINKS)
    service = Service(load(str(config)), None, None, elevation=(), beside_recording={})
    service._alarm = armed = Armed()
    service._on_bytes("autopilot", OF_AN_UNKNOWN_ID)
    assert armed.strict_after_ms == [QUIET_NS / NS_PER_MS]
