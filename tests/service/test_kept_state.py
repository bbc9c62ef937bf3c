"""Files of the state directory that a user or a power cut has spoiled: set aside, reported, not used."""

from __future__ import annotations

import hashlib
import json
import os
import tracemalloc
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from flying import CAMERA, LINK

from fwav_companion.config import Config, load
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.wire.signing import UNITS_PER_S, SigningClock, timestamp_from_unix_ns
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.service.calibration_store import CalibrationStore
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.service.signing_store import SigningStore
from fwav_companion.types import Message

SOUND = {
    "time_offset_s": 0.035, "time_offset_sigma_s": 0.001, "mount": [0.01, 0.02, 0.03], "mount_sigma": [0.01] * 3,
}  # fmt: skip
NOW_UNIX_NS = 1_800_000_000 * 10**9
NOW = timestamp_from_unix_ns(NOW_UNIX_NS)
YEAR = 365 * 86_400 * UNITS_PER_S


@pytest.fixture
def config(tmp_path: Path) -> Config:
    (tmp_path / "camera.yaml").write_text(CAMERA)
    path = tmp_path / "flight.toml"
    path.write_text(
        LINK
        + '[camera]\ncalibration = "camera.yaml"\n[tracking]\nself_calibration = true\n'
        + '[signing]\nkey_file = "k"\n[state]\ndirectory = "state"\n'
    )
    (tmp_path / "state").mkdir()
    return load(path)


class State:
    """The state directory, with a calibration of the configured camera, and what the stores report about it."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.folder = config.resolve("state")
        self.reported: list[str] = []
        store = CalibrationStore(config, pytest.fail)
        store.start()
        store.tick(KeptCalibration(**{**SOUND, "mount": (0.01, 0.02, 0.03), "mount_sigma": (0.01,) * 3}))
        store.close(5.0)
        self.calibration = self.folder / "calibration.json"

    def alter(self, **values: Any) -> None:
        content = json.loads(self.calibration.read_text())
        content["calibration"].update(values)
        self.calibration.write_text(json.dumps(content))

    def kept(self) -> KeptCalibration | None:
        return CalibrationStore(self.config, self.reported.append).kept()

    def first_timestamp(self, kept: bytes, *, synchronised: bool) -> int:
        path = self.folder / "signing.json"
        path.write_bytes(kept)
        os.utime(path, ns=(NOW_UNIX_NS - 10**9, NOW_UNIX_NS - 10**9))
        store = SigningStore(self.config, self.reported.append, lambda: synchronised)
        return store.starting_timestamp(NOW_UNIX_NS)


@pytest.fixture
def state(config: Config) -> State:
    return State(config)


def test_kept_calibration_within_the_priors_is_used(state: State) -> None:
    state.alter(time_offset_s=0.059, mount=[0.1, 0.0, -0.2])
    assert state.kept() is not None
    assert state.reported == []


@pytest.mark.parametrize(
    "values",
    [
        {"time_offset_s": 1e300},
        {"time_offset_s": -0.061},
        {"mount": [0.0, 3.1, 0.0]},
        {"mount": [0.0, 0.0, 0.24]},
        {"time_offset_sigma_s": 0.0},
        {"mount_sigma": [0.01, -0.01, 0.01]},
        {"mount": [0.0, 0.0]},
        {"time_offset_s": "late"},
        {"mount": None},
        {"position_delay_s": 11.0, "position_delay_sigma_s": 0.01},
        {"position_delay_s": 0.1},
        {"lever_m": [0.0, 99.0, 0.0], "lever_sigma_m": [0.01, 0.01, 0.01]},
    ],
    ids=str,
)
def test_kept_calibration_outside_its_range_is_set_aside_and_reported_once(state: State, values) -> None:
    state.alter(**values)
    spoiled = state.calibration.read_bytes()
    assert state.kept() is None
    (text,) = state.reported
    assert str(state.calibration) in text
    assert "calibration.json.bad" in text
    assert (state.folder / "calibration.json.bad").read_bytes() == spoiled
    assert state.kept() is None, "the next start has no file, and nothing to report"
    assert len(state.reported) == 1


@pytest.mark.parametrize("content", [b"", b"null", b"{", b'{"camera": 5}', b"\xff\xfe", b"[1, 2", b"NaN",
                                     b'{"x":' + b"[" * 60_000, b'{"calibration":' + b'{"x":' * 10_000])  # fmt: skip
def test_kept_calibration_that_is_no_calibration_is_set_aside(state: State, content: bytes) -> None:
    state.calibration.write_bytes(content)
    assert state.kept() is None
    assert len(state.reported) == 1
    assert not state.calibration.exists()


def test_kept_calibration_from_before_the_gimbals_keys_is_of_the_same_camera(config: Config) -> None:
    camera = msgspec.to_builtins(config.camera)
    for key in ("gimbal_yaw_bias_deg", "gimbal_delay_s"):
        del camera["mount"][key]
    before = hashlib.sha256(msgspec.json.encode(camera) + config.calibration_path.read_bytes()).hexdigest()
    content = json.dumps({"camera": before, "calibration": SOUND})
    (config.resolve("state") / "calibration.json").write_text(content)
    kept = CalibrationStore(config, pytest.fail).kept()
    assert kept is not None
    assert kept.position_delay_s is None


def test_kept_calibration_of_another_camera_is_neither_used_nor_reported(state: State) -> None:
    content = json.loads(state.calibration.read_text())
    content["calibration"]["time_offset_s"] = 0.5
    state.calibration.write_text(json.dumps({**content, "camera": "another"}))
    assert state.kept() is None
    assert state.reported == []


def test_state_file_of_three_gigabytes_is_not_read_whole(state: State) -> None:
    with state.calibration.open("r+b") as file:
        file.truncate(3 * 10**9)  # sparse: it takes no room
    tracemalloc.start()
    assert state.kept() is None
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1_000_000
    assert "64 KiB" in state.reported[0]


@pytest.mark.parametrize("kind", ["folder", "pipe"])
def test_state_file_that_is_not_a_regular_file_is_reported(state: State, kind: str) -> None:
    state.calibration.unlink()
    state.calibration.mkdir() if kind == "folder" else os.mkfifo(state.calibration)
    assert state.kept() is None
    assert str(state.calibration) in state.reported[0]


@pytest.mark.parametrize("kept", [b"-5", b"0", b"281474976710655", b"1e300", b'"now"', b"", b"[]", b"NaN"])
def test_signing_time_outside_its_range_starts_from_utc_and_names_the_remedy(state: State, kept: bytes) -> None:
    assert state.first_timestamp(kept, synchronised=True) == NOW
    (text,) = state.reported
    assert "set a new key" in text
    assert (state.folder / "signing.json.bad").read_bytes() == kept


def test_signing_time_without_utc_starts_from_the_newest_plausible_time(state: State) -> None:
    assert state.first_timestamp(b"-5", synchronised=False) == NOW + 1
    os.utime(state.folder)
    path = state.folder / "signing.json"
    path.write_bytes(b"-5")
    os.utime(path, ns=(NOW_UNIX_NS, NOW_UNIX_NS))
    store = SigningStore(state.config, state.reported.append, lambda: False)
    assert store.starting_timestamp(0) == NOW + 1, "the board's clock says 1970; the file was written later"


@pytest.mark.parametrize(("synchronised", "used"), [(True, False), (False, True)])
def test_signing_time_two_years_ahead_counts_unless_utc_is_known(state: State, synchronised: bool, used: bool) -> None:
    kept = NOW + 2 * YEAR
    first = state.first_timestamp(str(kept).encode(), synchronised=synchronised)
    assert (first == kept + 1) is used
    assert (state.reported == []) is used


def test_signing_time_of_the_last_ten_years_is_refused_without_utc(state: State) -> None:
    assert state.first_timestamp(str(2**48 - 9 * YEAR).encode(), synchronised=False) == NOW + 1


@pytest.mark.parametrize("years", [80, 400])
def test_signing_time_starts_from_no_implausible_clock_or_date_of_a_file(state: State, years: int) -> None:
    """A power cut leaves any date behind, a clock that lost its battery any time: no receiver would take us again."""
    late_ns = NOW_UNIX_NS + years * 365 * 86_400 * 10**9
    path = state.folder / "signing.json"
    store = SigningStore(state.config, state.reported.append, lambda: False)
    assert store.starting_timestamp(late_ns) == 0, "the first run"
    path.write_bytes(b"-5")
    os.utime(path, ns=(late_ns, late_ns))
    assert store.starting_timestamp(NOW_UNIX_NS) == NOW + 1


def test_signing_time_does_not_follow_an_autopilot_of_an_implausible_year(state: State) -> None:
    """Who deceives its receiver of satellites would move our time to the last one for good."""
    store, clock = SigningStore(state.config, pytest.fail, lambda: False), SigningClock(NOW)
    store.begin(clock, HostNs(0))
    for unix_us in (2**63, NOW_UNIX_NS // 1000 + 80 * 365 * 86_400 * 10**6):
        fields = SimpleNamespace(time_unix_usec=unix_us)
        message = Message(name="SYSTEM_TIME", system=1, component=1, link="a", fields=fields, signed=True)
        store.on_message(message, (1, 1), HostNs(0))
    for second in range(1, 600):
        clock.tick(HostNs(second * 10**9))
        store.tick(HostNs(second * 10**9), 0)
    assert clock.timestamp < NOW + 601 * UNITS_PER_S


def test_camera_file_beyond_a_megabyte_is_refused_before_it_is_read_whole(config: Config) -> None:
    """Its start was taken, and the whole was read for the fingerprint and for each recording."""
    start = f"{CAMERA}# ".encode()
    with config.calibration_path.open("wb") as file:
        file.write(start + b"#" * (len(start) % 2) + "é".encode() * (1 << 19))
        file.truncate(3 << 30)
    tracemalloc.start()
    with pytest.raises(InputFileError, match="longer than 1048576 bytes"):
        load_calibration(config)
    assert tracemalloc.get_traced_memory()[1] < 8 << 20
    tracemalloc.stop()
