"""Faults planted in folders of files that imitate a board: `check` names each, and nothing on a healthy board."""

import subprocess
import sys
from pathlib import Path

import pytest
from configured_links import AUTOPILOT
from hearing import codes

from fwav_companion.config import parse
from fwav_companion.tools.doctor.board import Probe
from fwav_companion.tools.doctor.evidence import Board, Evidence, Files, SerialPort
from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.gathering import load_files
from fwav_companion.tools.doctor.link_findings import port_findings

TEXT = AUTOPILOT.replace("udpin://127.0.0.1:14540", "serial:///dev/serial0:921600") + (
    '[camera]\ncalibration = "camera.yaml"\n[vision]\nsource = "/dev/video0"\n'
    '[record]\ndirectory = "records"\n[state]\ndirectory = "state"\n'
)
CAMERA = """
model: kannala_brandt
image_size: [640, 480]
k_mm: [3.55, 0.03, 0.0, 0.0, 0.0]
pixels_per_mm: [188.0, 188.0]
principal_point: [320.0, 240.0]
"""


class Pi:
    """A healthy Raspberry Pi; each test plants one fault."""

    def __init__(self, folder: Path) -> None:
        self.root, self.home = folder / "root", folder / "home"
        self.text, self.throttled, self.denied = TEXT, "throttled=0x0\n", set()
        self.put("/proc/cmdline", "console=tty1 root=/dev/mmcblk0p2 rootwait\n")
        self.put("/proc/device-tree/model", "Raspberry Pi Zero 2 W Rev 1.0\0")
        self.put("/proc/self/mountinfo", "21 1 179:2 / / rw,noatime - ext4 /dev/mmcblk0p2 rw\n")
        self.put("/etc/fstab", "PARTUUID=1-02 / ext4 defaults,noatime 0 1\n")
        self.put("/proc/mounts", "/dev/mmcblk0p2 / ext4 rw,noatime 0 0\ntmpfs /run tmpfs rw 0 0\n")
        self.put("/sys/class/hwmon/hwmon1/name", "rpi_volt\n")
        self.put("/sys/class/hwmon/hwmon1/in0_lcrit_alarm", "0\n")
        for device in ("ttyAMA0", "ttyS0", "video0", "tty1"):
            self.put(f"/dev/{device}", "")
        self.link("/dev/serial0", "ttyAMA0")
        self.link("/dev/serial1", "ttyS0")
        self.put("/sys/devices/platform/soc/uart0/uevent", "")
        self.put("/sys/devices/platform/soc/uart1/bluetooth/hci0/uevent", "")
        for name, uart in (("ttyAMA0", "uart0"), ("ttyS0", "uart1")):
            self.link(f"/sys/class/tty/{name}/device", self.root / "sys/devices/platform/soc" / uart)
        self.link("/sys/class/bluetooth/hci0", self.root / "sys/devices/platform/soc/uart1/bluetooth/hci0")
        for name in ("records", "state"):
            (self.home / name).mkdir(parents=True)
        (self.home / "camera.yaml").write_text(CAMERA)

    def put(self, path: str, text: str) -> None:
        at = self.root / path.lstrip("/")
        at.parent.mkdir(parents=True, exist_ok=True)
        at.unlink(missing_ok=True)
        at.write_text(text)

    def link(self, path: str, target: str | Path) -> None:
        at = self.root / path.lstrip("/")
        at.parent.mkdir(parents=True, exist_ok=True)
        at.unlink(missing_ok=True)
        at.symlink_to(target)

    def remove(self, path: str) -> None:
        (self.root / path.lstrip("/")).unlink()

    def found(self) -> list[str]:
        return codes(self.findings())

    def findings(self) -> list[Finding]:
        config = parse(self.text, str(self.home / "flight.toml"))
        probe = Probe(self.root, may=self._may, throttled=lambda: self.throttled, environment={})
        files, _ = load_files(config)
        board = probe.board(config, {})
        return examine(Evidence(config=config, board=board, files=files, status=None))

    def _may(self, path: Path, _mode: int) -> bool:
        return path.name not in self.denied


@pytest.fixture
def pi(tmp_path):
    return Pi(tmp_path)


def test_a_healthy_board_has_nothing_to_change(pi):
    assert pi.found() == []


PUT = {
    "console by alias": (
        "/proc/cmdline",
        "console=serial0,115200 console=tty1 root=/dev/mmcblk0p2\n",
        "serial_console",
    ),
    "console that is active": ("/sys/class/tty/console/active", "tty0 ttyAMA0\n", "serial_console"),
    "low voltage now": ("/sys/class/hwmon/hwmon1/in0_lcrit_alarm", "1\n", "undervoltage"),
    "low voltage by firmware": ("/sys/devices/platform/soc/soc:firmware/get_throttled", "50005\n", "undervoltage"),
    "mounted read only": ("/proc/mounts", "/dev/mmcblk0p2 / ext4 ro,noatime 0 0\n", "read_only"),
    "root in memory": ("/proc/mounts", "/dev/mmcblk0p2 / ext4 rw 0 0\noverlay / overlay rw 0 0\n", "volatile"),
}
"""File of the board, its content, and the code of the finding."""


@pytest.mark.parametrize("fault", PUT)
def test_a_fault_in_a_file_of_the_board_is_named_and_no_other(pi, fault):
    path, text, code = PUT[fault]
    pi.put(path, text)
    assert set(pi.found()) == {code}


def no_port(pi):
    pi.remove("/dev/serial0")


def no_usb_device(pi):
    pi.text = pi.text.replace("/dev/serial0", "1209:5740")


def bluetooth_by_alias(pi):
    pi.text = pi.text.replace("/dev/serial0", "/dev/serial1")


def bluetooth_by_adapter(pi):
    pi.put("/proc/device-tree/model", "Some Board\0")
    pi.text = pi.text.replace("/dev/serial0", "/dev/ttyS0")


def mini_uart(pi):
    pi.link("/dev/serial0", "ttyS0")
    pi.link("/dev/serial1", "ttyAMA0")
    pi.remove("/sys/class/bluetooth/hci0")


def low_voltage_before(pi):
    pi.throttled = "throttled=0x50000\n"


def too_hot(pi):
    pi.throttled = "throttled=0x4\n"


def full_disk(pi):
    pi.text = pi.text.replace('directory = "records"', 'directory = "records"\nmin_free_mb = 1e9')


def no_camera_file(pi):
    (pi.home / "camera.yaml").unlink()


def another_file(pi):
    (pi.home / "camera.yaml").write_text("model: pinhole\n")


def open_key(pi):
    (pi.home / "signing.key").write_bytes(bytes(32))
    (pi.home / "signing.key").chmod(0o644)
    pi.text += '[signing]\nkey_file = "signing.key"\n'


def nothing_kept(pi):
    pi.text = pi.text.replace('[state]\ndirectory = "state"\n', "[tracking]\nself_calibration = true\n")


def no_video(pi):
    pi.remove("/dev/video0")


def no_terrain(pi):
    pi.text += '[ground]\nmodel = "terrain"\nterrain = ["N48E011.hgt"]\nterrain_datum = "egm96"\n'


PLANTED = {
    no_port: "port_missing",
    no_usb_device: "port_missing",
    bluetooth_by_alias: "bluetooth_on_port",
    bluetooth_by_adapter: "bluetooth_on_port",
    mini_uart: "mini_uart",
    low_voltage_before: "undervoltage",
    too_hot: "throttled",
    full_disk: "disk_full",
    no_camera_file: "calibration",
    another_file: "calibration",
    open_key: "signing_key",
    nothing_kept: "no_state",
    no_video: "camera_missing",
    no_terrain: "terrain_file",
}


@pytest.mark.parametrize("plant", PLANTED, ids=lambda plant: plant.__name__)
def test_a_fault_is_named_and_no_other(pi, plant):
    plant(pi)
    assert set(pi.found()) == {PLANTED[plant]}


def plug_in(pi, ids):
    """A flight controller on USB, as the kernel lists one."""
    device = pi.root / "sys/devices/platform/soc/usb/1-1"
    for name, text in zip(("idVendor", "idProduct"), ids.split(":"), strict=True):
        pi.put(str(device.relative_to(pi.root) / name), f"{text}\n")
    pi.put(str(device.relative_to(pi.root) / "1-1:1.0/uevent"), "")
    pi.link("/sys/class/tty/ttyACM0/device", device / "1-1:1.0")
    pi.put("/dev/ttyACM0", "")


def test_a_recording_directory_below_a_disk_that_is_not_mounted_is_named_with_the_disk(pi):
    pi.put("/etc/fstab", f"/dev/sda1 {pi.home}/records ext4 nofail 0 2\n")
    (finding,) = pi.findings()
    assert codes([finding]) == ["not_mounted"]
    assert f"nothing is mounted at {pi.home}/records (/dev/sda1 in /etc/fstab)" in str(finding)
    pi.put("/proc/self/mountinfo", f"21 1 179:2 / / rw - ext4 a rw\n40 21 8:1 / {pi.home}/records rw - ext4 b rw\n")
    assert pi.found() == []


def test_a_file_in_place_of_a_directory_is_named(pi):
    pi.text = pi.text.replace('directory = "records"', 'directory = "camera.yaml/records"')
    (finding,) = pi.findings()
    assert (finding.code, f"{pi.home}/camera.yaml is a file" in finding.problem) == ("read_only", True)


def test_a_port_by_its_usb_ids_is_found_or_named_with_what_is_there(pi):
    pi.text = pi.text.replace("/dev/serial0", "1209:5740")
    plug_in(pi, "1209:5740")
    assert pi.found() == []
    pi.denied.add("ttyACM0")
    assert pi.found() == ["port_permission"]
    plug_in(pi, "26ac:0011")
    (missing,) = pi.findings()
    assert (missing.code, "USB 1209:5740" in missing.problem) == ("port_missing", True)
    assert "/dev/ttyACM0 (26ac:0011)" in missing.problem


def test_a_folder_that_may_not_be_looked_at_breaks_nothing(pi):
    pi.text = pi.text.replace('directory = "records"', f'directory = "/{"x" * 300}"')
    assert pi.found() in ([], ["read_only"])


@pytest.mark.parametrize(
    ("denied", "code"),
    [("serial0", "port_permission"), ("video0", "camera_permission"), ("records", "read_only"), ("state", "read_only")],
)
def test_a_file_that_may_not_be_opened_is_named(pi, denied, code):
    pi.denied.add(denied)
    assert pi.found() == [code]


def test_the_fix_of_a_device_of_roots_group_does_not_make_its_user_a_member_of_it():
    theirs, roots = (
        SerialPort(link="a", device=device, baud=57600, exists=True, allowed=False, group=group)
        for device, group in (("/dev/ttyUSB0", "dialout"), ("/dev/ttyS0", "root"))
    )
    evidence = Evidence(config=None, board=Board(user="pi", ports=[theirs, roots]), files=Files(), status=None)
    member = "sudo usermod -aG dialout pi, then log in again"
    keep = "sudo chgrp dialout /dev/ttyS0; sudo chmod g+rw /dev/ttyS0 (a udev rule keeps both)"
    assert [finding.fix for finding in port_findings(evidence)] == [member, f"{keep}; {member}"]


def test_the_holder_of_a_port_is_found_by_its_socket():
    code = (
        "import socket; s = socket.socket(type=socket.SOCK_DGRAM); s.bind(('127.0.0.1', 0))\n"
        "print(s.getsockname()[1], flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as holder:
        port = holder.stdout.readline().strip()
        config = parse(AUTOPILOT.replace("14540", port) + '[detections]\nurl = ""\n', "flight.toml")
        board = Probe(throttled=lambda: "").board(config, {"autopilot": "Address already in use"})
        assert f"(pid {holder.pid})" in board.holders["autopilot"]
        holder.communicate("\n")


def test_this_machine_can_be_probed(tmp_path):
    (tmp_path / "camera.yaml").write_text(CAMERA)
    Probe().board(parse(TEXT, str(tmp_path / "flight.toml")), {"autopilot": "busy", "detections": "in use"})
