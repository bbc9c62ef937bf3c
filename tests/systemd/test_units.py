"""The systemd files of a board against the service's behaviour and its contract."""

import json
import re
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest

from fwav_companion.config import load
from fwav_companion.service.housekeeping import INTERVAL_S
from fwav_companion.tools.install.system import CONFIGURATION, ENVIRONMENT

FOLDER = Path(__file__).parents[2] / "systemd"
UNIT = FOLDER / "fwav-companion.service"
SECTIONS = {"Unit", "Service", "Install"}


def settings() -> dict[str, list[str]]:
    """``Section.Key`` to its values, by the syntax of systemd.syntax(7); anything else in the file is an error."""
    found: dict[str, list[str]] = defaultdict(list)
    section = ""
    for line in UNIT.read_text().splitlines():
        if not line or line.startswith("#"):
            continue
        if heading := re.fullmatch(r"\[(\w+)\]", line):
            section = heading[1]
            assert section in SECTIONS
            continue
        setting = re.fullmatch(r"([A-Z]\w+)=(.*)", line)
        assert setting is not None, line
        assert "#" not in setting[2], "systemd has no comments at the end of a line"
        found[f"{section}.{setting[1]}"].append(setting[2])
    return found


def the(key: str) -> str:
    (value,) = settings()[key]
    return value


def test_nothing_is_said_twice_but_lists():
    assert {key for key, values in settings().items() if len(values) > 1} == {
        "Service.DeviceAllow",
        "Service.SystemCallFilter",
    }


def test_ready_is_notified_and_a_wrong_configuration_is_not_retried():
    assert the("Service.Type") == "notify"
    assert the("Service.RestartPreventExitStatus") == "2"
    assert the("Service.Restart") == "always"
    assert the("Unit.StartLimitIntervalSec") == "0"
    assert float(the("Service.TimeoutStopSec")) >= 2.0, "a clean stop takes up to that"


def test_the_watchdog_is_notified_in_time():
    assert float(the("Service.WatchdogSec")) / 2.0 >= INTERVAL_S, "sd_watchdog_enabled(3): at half of the limit"


def test_it_runs_the_installed_command_with_the_installed_configuration():
    program, *arguments = the("Service.ExecStart").split()
    assert program == f"{ENVIRONMENT}/bin/fwav-companion"
    assert arguments == ["run", "--config", CONFIGURATION]
    for readme in (FOLDER / "README.md", FOLDER.parent / "README.md"):
        assert "bin/fwav-companion install\n" in readme.read_text()


def test_its_own_user_and_its_own_folders():
    assert the("Service.User") == "fwav-companion"
    assert the("Service.SupplementaryGroups").split() == ["dialout", "video"]
    for folder in ("ConfigurationDirectory", "StateDirectory", "RuntimeDirectory"):
        assert the(f"Service.{folder}") == "fwav-companion"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("NoNewPrivileges", "yes"),
        ("CapabilityBoundingSet", ""),
        ("ProtectSystem", "strict"),
        ("ProtectHome", "yes"),
        ("PrivateTmp", "yes"),
        ("RestrictAddressFamilies", "AF_UNIX AF_INET AF_INET6 AF_NETLINK"),
        ("DevicePolicy", "closed"),
        ("MemoryHigh", "300M"),
        ("MemoryMax", "400M"),
        ("OOMPolicy", "continue"),
        ("UMask", "0027"),
        ("RuntimeDirectoryMode", "0755"),
        ("PrivateMounts", "yes"),
        ("ProtectProc", "invisible"),
        ("RemoveIPC", "yes"),
    ],
)
def test_what_it_needs_and_no_more(key: str, value: str):
    assert the(f"Service.{key}") == value


def test_system_calls_that_change_privileges_or_resources_are_refused():
    """The allow list comes first; what follows is taken out of it (systemd.exec(5))."""
    assert settings()["Service.SystemCallFilter"] == ["@system-service", "~@privileged @resources"]


OPEN_ON_PURPOSE = {
    "PrivateDevices": "serial ports and cameras",
    "DeviceAllow": "serial ports and cameras",
    "SupplementaryGroups": "dialout, video",
    "PrivateNetwork": "MAVLink by UDP and TCP",
    "RestrictAddressFamilies_AF_INET_INET6": "MAVLink by UDP and TCP",
    "RestrictAddressFamilies_AF_UNIX": "detections and systemd's notifications",
    "RestrictAddressFamilies_AF_NETLINK": "names of interfaces",
    "IPAddressDeny": "any address may be a link's",
    "PrivateUsers": "the group of a device must be known",
    "ProcSubset": "load, memory and temperature of the board",
    "RootDirectoryOrRootImage": "libraries of the system, as picamera2",
    "UMask": "the group reads recordings",
    "MemoryDenyWriteExecute": "networks are compiled at run time",
}
"""What systemd-analyze counts as exposed although the service needs it, and what for."""


def systemd_version() -> int:
    """The version of the installed systemd-analyze; 0 where there is none."""
    if shutil.which("systemd-analyze") is None:
        return 0
    done = subprocess.run(["systemd-analyze", "--version"], capture_output=True, text=True, timeout=60, check=True)
    return int(done.stdout.split()[1].partition(".")[0].partition("~")[0])


def test_systemd_finds_nothing_open_that_is_not_needed():
    if systemd_version() < 250:
        pytest.skip("systemd-analyze has --offline and --json from version 250 on")
    command = ["systemd-analyze", "security", "--offline=true", "--json=short", str(UNIT)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    exposed = {each["json_field"] for each in json.loads(done.stdout) if float(each["exposure"] or 0) > 0}
    assert exposed <= set(OPEN_ON_PURPOSE)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_the_exposure_is_at_most_one_and_a_half():
    command = ["systemd-analyze", "security", "--offline=true", "--threshold=15", "--no-pager", str(UNIT)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "unrecognized option" in done.stderr:
        pytest.skip("systemd-analyze before systemd 250")
    assert done.returncode == 0, done.stdout[-200:]


def test_what_stays_open_is_said_in_the_unit():
    """systemd's own words for it, but for those that a setting of the unit names."""
    comments = " ".join(line for line in UNIT.read_text().splitlines() if line.startswith("#"))
    for name in (
        "MemoryDenyWriteExecute",
        "PrivateDevices",
        "PrivateNetwork",
        "PrivateUsers",
        "ProcSubset",
        "RootDirectory",
    ):
        assert f"{name}=" in comments, name


def test_a_flood_of_lines_does_not_fill_the_journal():
    assert (the("Service.LogRateLimitIntervalSec"), the("Service.LogRateLimitBurst")) == ("30", "1000")


def test_devices_that_are_plugged_in_later_are_allowed_by_number():
    allowed = dict(value.split() for value in settings()["Service.DeviceAllow"])
    majors = {"ttyS": 4, "video4linux": 81, "ttyACM": 166, "ttyUSB": 188, "ttyAMA": 204}  # Linux: devices.txt
    assert {f"char-{major}" for major in majors.values()} <= set(allowed)
    assert set(allowed.values()) == {"rw"}


def test_the_sample_configuration_is_one_that_run_takes():
    config = load(FOLDER / "fwav-companion.toml")
    config.require_links()
    assert str(config.detections.parsed_url) == "unix:///run/fwav-companion/detections"
    assert config.record.directory.startswith("/var/lib/fwav-companion/")
    assert config.camera.calibration == "camera.yaml"


def test_the_udev_rules_have_no_line_that_udev_cannot_read():
    """Comma-separated KEY OP "VALUE"; the two jumps lead to the label."""
    part = r'[A-Z_]+(\{\w+\})?(==|!=|=|\+=)"[^"]*"'
    lines = [x for x in (FOLDER / "99-fwav-companion.rules").read_text().splitlines() if x and not x.startswith("#")]
    for line in lines:
        assert re.fullmatch(rf"{part}(, {part})*", line), line
    assert lines[-1] == 'LABEL="fwav_companion_end"'
    assert sum('GOTO="fwav_companion_end"' in line for line in lines) == 2
    ids = re.findall(r'idVendor}=="(\w+)"', "\n".join(lines))
    assert all(re.fullmatch("[0-9a-f]{4}", vendor) for vendor in ids), "udev compares text: lower case"
    assert any('SYMLINK+="autopilot"' in line for line in lines)
