"""What `run` records: the flight again, after a clean stop and after kill -9, on a disk that fails, and no secrets."""

import json
import resource
import signal
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader
from processes import GroundStation, free_port, process
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.cli.main import main
from fwav_companion.config import load
from fwav_companion.recording.tlog import TlogRecord, read_tlog
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.service.calibration_store import CalibrationStore

KEY = bytes(range(200, 232))


class Site:
    """init's files with recording switched on, pointed at ports of this test's own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.autopilot, self.detections = folder, free_port(), free_port()
        self.ground = GroundStation()
        assert main(["init", str(folder)]) == 0
        self.replace("serial:///dev/serial0:921600", f"udpin://127.0.0.1:{self.autopilot}")
        self.replace("udpout://127.0.0.1:14550", f"udpout://127.0.0.1:{self.ground.port}")
        self.replace("udpin://127.0.0.1:14601", f"udpin://127.0.0.1:{self.detections}")
        self.replace('\nfile = ""', f'\nfile = "{folder}/status.json"')
        self.replace('directory = ""                # "" records', 'directory = "records"  # "" records')

    def replace(self, old: str, new: str) -> None:
        path = self.folder / "fwav-companion.toml"
        assert old in path.read_text(), old
        path.write_text(path.read_text().replace(old, new, 1))

    def service(self):
        return process("fwav_companion", "run", "--config", "fwav-companion.toml", folder=self.folder)

    def mock(self, *words: str):
        return process(
            *("sitl_mock", "--connect", f"udpout:127.0.0.1:{self.autopilot}", "--scenario", "unbiased", "--seed", "2"),
            *("--detections", f"127.0.0.1:{self.detections}", *words),
            folder=self.folder,
        )

    def recordings(self) -> list[Path]:
        return sorted((self.folder / "records").iterdir())

    def replayed(self, folder: Path) -> bytes:
        """The targets of a recording that is replayed with the configuration that lies in it."""
        names = {"telemetry": "telemetry.tlog", "detections": "detections.jsonl", "config": "fwav-companion.toml"}
        words = [word for option, name in names.items() for word in (f"--{option}", str(folder / name))]
        assert main(["replay", *words, "--out", str(self.folder / "again.jsonl")]) == 0
        return (self.folder / "again.jsonl").read_bytes()


@pytest.fixture
def site(tmp_path):
    site = Site(tmp_path)
    yield site
    site.ground.close()


def frames_of(folder: Path) -> list[bytes]:
    items = list(read_tlog((folder / "telemetry.tlog").read_bytes()))
    return [item.frame for item in items if isinstance(item, TlogRecord)]


def wait_until_it_tracks(site: Site) -> None:
    site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=15)


def test_a_recorded_flight_replays_to_the_output_of_run(site: Site):
    with site.service() as service, site.mock("--set", "camera.late_every=7", "--set", "camera.late_by_s=0.2"):
        wait_until_it_tracks(site)
        assert service.stop() == 0
    (folder,) = site.recordings()
    said = (folder / "targets.jsonl").read_bytes()
    assert said.count(b'"type":"target"') > 20
    assert site.replayed(folder) == said


def test_recorded_flight_with_a_station_that_floods_the_autopilot_replays_to_the_output_of_run(site: Site):
    """2 kB in one frame after another, at 40 Hz: most exchanges have relayed bytes beside them."""
    rtcm = dialect.MAVLink_gps_rtcm_data_message(flags=0, len=180, data=[1] * 180)
    with site.service() as service, site.mock():
        site.ground.listen(until="HEARTBEAT")
        for _ in range(120):
            for _ in range(10):
                site.ground.send(rtcm)
            site.ground.listen_during(0.025)
        assert service.stop() == 0
    (folder,) = site.recordings()
    kept = (folder / "targets.jsonl").read_bytes()
    assert kept.count(b'"type":"target"') > 20
    assert site.replayed(folder) == kept


def test_kill_9_leaves_files_that_read_and_all_but_the_last_second(site: Site):
    with site.service() as service, site.mock():
        wait_until_it_tracks(site)
        killed_unix_s = time.time()
        service.stop(signal.SIGKILL)
    (folder,) = site.recordings()
    items = list(read_tlog((folder / "telemetry.tlog").read_bytes()))
    last = [item for item in items if isinstance(item, TlogRecord)][-1]
    assert killed_unix_s - last.unix_us / 1e6 < 1.0
    said, again = (folder / "targets.jsonl").read_bytes(), site.replayed(folder)
    whole = said[: said.rindex(b"\n") + 1]
    assert whole.count(b'"type":"target"') > 10
    assert again.startswith(whole[: whole.rindex(b"\n", 0, len(whole) - 1) + 1])
    assert main(["export", str(folder), "--out", str(site.folder / "flight.mcap")]) == 0
    with (site.folder / "flight.mcap").open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    names = {channel.id: channel.topic for channel in summary.channels.values()}
    counts = {names[channel]: count for channel, count in summary.statistics.channel_message_counts.items()}
    assert counts["/targets/estimates"] == whole.count(b'"type":"target"')


def test_a_disk_that_takes_no_more_stops_the_recording_and_not_the_service(site: Site):
    with site.service() as service, site.mock():
        service.wait_for("link autopilot is up")
        pid = json.loads(wait_for_file(site.folder / "status.json"))["pid"]
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (30_000, 30_000))
        service.wait_for("recording stopped: .*File too large")
        wait_until_it_tracks(site)
        assert service.stop() == 0
    assert service.said.count("recording stopped") == 1
    (folder,) = site.recordings()
    assert len(frames_of(folder)) > 100


def wait_for_file(path: Path) -> bytes:
    """Its content, once there is any; the test's own time limit ends the wait."""
    while not path.exists():
        time.sleep(0.05)
    return path.read_bytes()


def test_keys_and_signatures_never_get_in(site: Site):
    key_file = site.folder / "signing.key"
    key_file.write_bytes(KEY)
    key_file.chmod(0o600)
    with (site.folder / "fwav-companion.toml").open("a") as file:
        file.write('\n[signing]\nkey_file = "signing.key"\naccept_unsigned = ["autopilot"]\n')
    with site.service() as service, site.mock():
        wait_until_it_tracks(site)
        for _ in range(3):
            site.ground.send(dialect.MAVLink_setup_signing_message(1, 1, list(KEY), 5))
        site.ground.listen(until="HEARTBEAT", count=3)
        assert service.stop() == 0
    (folder,) = site.recordings()
    frames = frames_of(folder)
    assert any(frame[5:7] == b"\x01\xbf" for frame in frames), "none of our own frames was recorded"
    assert not any(frame[0] == 0xFD and frame[2] & 1 for frame in frames)
    assert 256 not in {int.from_bytes(frame[7:10], "little") for frame in frames if frame[0] == 0xFD}
    for path in folder.iterdir():
        assert KEY not in path.read_bytes()
        assert path.name != "signing.key"


def test_it_records_while_armed_and_from_half_a_minute_before(site: Site):
    site.replace('when = "always"', 'when = "armed"')
    with site.service() as service, site.mock("--set", "autopilot.arms_at_s=6.0"):
        service.wait_for("autopilot found")
        assert list((site.folder / "records").iterdir()) == []
        wait_until_it_tracks(site)
        while not list((site.folder / "records").iterdir()):
            time.sleep(0.1)
        site.ground.listen(until="HEARTBEAT", count=6)
        assert service.stop() == 0
    (folder,) = site.recordings()
    lines = [json.loads(line) for line in (folder / "targets.jsonl").read_text().splitlines()]
    assert [lines[0]["type"], lines[-1]["type"]] == ["header", "summary"]
    assert (folder / "targets.jsonl").read_bytes() == site.replayed(folder)


def test_a_flight_that_began_with_a_kept_calibration_replays_with_it(site: Site):
    site.replace("self_calibration = false", "self_calibration = true")
    site.replace('directory = ""                # kept', 'directory = "state"  # kept')
    config = load(site.folder / "fwav-companion.toml")
    kept = KeptCalibration(
        time_offset_s=0.004, time_offset_sigma_s=0.002, mount=(0.01, -0.02, 0.0), mount_sigma=(0.01, 0.01, 0.03)
    )
    memory = CalibrationStore(config, pytest.fail)
    memory.start()
    memory.tick(kept)
    memory.close(5.0)
    assert memory.kept() == kept
    with site.service() as service, site.mock():
        wait_until_it_tracks(site)
        assert service.stop() == 0
    (folder,) = site.recordings()
    said = (folder / "targets.jsonl").read_bytes()
    assert b'"event":"began_with"' in (folder / "detections.jsonl").read_bytes()
    assert said.count(b'"type":"calibration"') > 3
    assert site.replayed(folder) == said
