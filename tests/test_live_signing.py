"""With a key: the daemon against pymavlink's own signing, as processes and sockets."""

import json
import os
import time
from pathlib import Path

import pytest
from processes import SIGNING_EPOCH_S, GroundStation, process
from sites import Site

KEY = bytes(range(32))
STOP_TRACKING, REQUEST_MESSAGE, CAMERA_INFORMATION = 2010, 512, 259
RUN = ("fwav_companion", "run", "--config", "fwav-companion.toml")
DAY = 24 * 3600 * 100_000
"""In units of 10 us."""


class SignedSite(Site):
    """The mock does not sign, so its link is one on which unsigned telemetry is accepted."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        port = self.ground.port
        self.ground.close()
        self.ground = GroundStation(key=KEY)
        self.replace(f"udpout://127.0.0.1:{port}", f"udpout://127.0.0.1:{self.ground.port}")
        (folder / "signing.key").write_bytes(KEY)
        (folder / "signing.key").chmod(0o600)
        with (folder / "fwav-companion.toml").open("a") as file:
            file.write('\n[signing]\nkey_file = "signing.key"\naccept_unsigned = ["autopilot"]\n')
        self.replace('[state]\ndirectory = ""', '[state]\ndirectory = "state"')


@pytest.fixture
def site(tmp_path: Path):
    site = SignedSite(tmp_path)
    yield site
    site.close()


def timestamp(message) -> int:
    """Of a signed message, as the frame carries it."""
    return int.from_bytes(bytes(message.get_msgbuf())[-12:-6], "little")


@pytest.mark.timeout(120)
def test_with_a_key_what_we_say_is_signed_and_only_signed_commands_are_done(site: SignedSite):
    with site.service() as service, site.mock("--scenario", "unbiased"):
        heard = site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=3)
        ours = [m for m in heard if m.get_srcSystem() == 1 and m.get_srcComponent() in (191, 100)]
        assert {m.get_type() for m in ours} >= {"HEARTBEAT", "CAMERA_TRACKING_GEO_STATUS"}
        assert all(m.get_signed() for m in ours)
        assert {m.get_signed() for m in heard if m.get_srcComponent() == 1} == {False}, "relayed as they came"

        assert site.ground.ask(100, REQUEST_MESSAGE, CAMERA_INFORMATION)[0] == 0
        unsigned_is_refused(site)
        forged_frame_locks_no_sender_out(site)
        traffic = {link["name"]: link for link in wait_for_status(site)["traffic"]}
        assert (traffic["ground"]["refused_signatures"], traffic["ground"]["late_copy"]) == (1, 1)
        assert traffic["ground"]["refused_unsigned"] == 1
        assert service.stop() == 0


def unsigned_is_refused(site: SignedSite) -> None:
    stranger = GroundStation(system=254)
    site.ground.send_bytes(stranger.packed_command(100, STOP_TRACKING))
    stranger.close()
    answers = [
        m for m in site.ground.listen_during(1.0) if m.get_type() == "COMMAND_ACK" and m.command == STOP_TRACKING
    ]
    assert answers == []


def forged_frame_locks_no_sender_out(site: SignedSite) -> None:
    """A genuine frame again, and one from the far future with a wrong signature; then genuine ones go on."""
    result, _ = site.ground.ask(100, REQUEST_MESSAGE, CAMERA_INFORMATION)
    assert result == 0
    frame = site.ground.command(191, 40_999)
    site.ground.send_bytes(frame)
    site.ground.send_bytes(frame[:-12] + b"\xff" * 6 + os.urandom(6))
    acks = [m for m in site.ground.listen_during(1.0) if m.get_type() == "COMMAND_ACK" and m.command == 40_999]
    assert [ack.result for ack in acks] == [3]
    assert site.ground.ask(100, STOP_TRACKING)[0] == 0


def wait_for_status(site: SignedSite) -> dict:
    time.sleep(1.1)  # it is written once a second
    return site.status()


@pytest.mark.timeout(120)
def test_signing_goes_on_ahead_after_a_restart(site: SignedSite):
    """The board's wall clock may have moved back a day meanwhile: the stored timestamp applies."""
    kept = round((time.time() - SIGNING_EPOCH_S) * 1e5) + DAY
    (site.folder / "state").mkdir()
    (site.folder / "state/signing.json").write_text(json.dumps(kept))
    stamps = []
    for _ in range(2):
        with site.service() as service:
            site.ground._parser.signing.stream_timestamps.clear()
            heard = site.ground.listen(until="HEARTBEAT", count=2)
            stamps.append([timestamp(m) for m in heard])
            assert service.stop() == 0
    first, second = stamps
    assert kept < min(first)
    assert max(first) < min(second)
    assert json.loads((site.folder / "state/signing.json").read_text()) > max(first)


def test_without_a_place_to_keep_it_that_is_reported_once(site: SignedSite):
    site.replace('directory = "state"', 'directory = ""')
    with process(*RUN, folder=site.folder, STATE_DIRECTORY="") as service:
        service.wait_for("link ground is up")
        assert service.stop() == 0
    assert service.said.count("the signing time is not kept") == 1
