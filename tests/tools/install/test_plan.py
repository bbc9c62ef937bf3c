"""The steps that are decided from an observed board: what is there stays, what the user edited is left alone."""

from pathlib import Path

import pytest

from fwav_companion.errors import UserError
from fwav_companion.tools.install.plan import plan
from fwav_companion.tools.install.source import source
from fwav_companion.tools.install.steps import (
    AwaitHeartbeat,
    MakeEnvironment,
    PointLink,
    Remark,
    RemovePath,
    RenamePath,
    Run,
    Step,
    WriteFile,
)
from fwav_companion.tools.install.system import (
    CAMERA_FILE,
    COMMAND,
    CONFIGURATION,
    ENVIRONMENT,
    HOME,
    NETWORK_DROP_IN,
    PROGRAM,
    UDEV_RULES,
    UNIT,
    USERS,
    Installed,
    Package,
    Platform,
    Request,
    System,
)

ARM64 = Platform(name="linux-aarch64")
SOURCE = Package(
    version="1.0",
    path="/src",
    extras=("terrain", "ulog"),
    files=source().files,
    locks={
        name: f"/src/requirements/{name}" for name in ("board.txt", "board-terrain.txt", "board-ulog.txt", "build.txt")
    },
)
SERIAL = (
    '[detections]\nurl = ""\n[[link]]\nname = "autopilot"\nurl = "serial:///dev/serial0:921600"\nrole = "autopilot"\n'
)


def kinds(steps: list[Step], kind: type) -> list:
    return [step for step in steps if isinstance(step, kind)]


def written(steps: list[Step]) -> dict[str, str]:
    return {step.path: step.content for step in kinds(steps, WriteFile)}


def done(steps: list[Step], system: System) -> System:
    """The system after the steps, as an independent reader of them: files written, environment linked."""
    texts = dict(system.texts)
    for step in steps:
        if isinstance(step, WriteFile):
            texts[step.path] = step.content
    (made,) = kinds(steps, MakeEnvironment)
    installed = Installed(version=SOURCE.version, extras=made.extras, system_packages=made.system_packages)
    name = made.path.rpartition("/")[2]
    return System(
        platform=system.platform, texts=texts, environment=name, environments=(name,), installed=installed,
        model=system.model, command=PROGRAM,
    )  # fmt: skip


EMPTY = System(platform=ARM64)


def test_a_fresh_board_gets_everything_and_the_second_run_changes_nothing():
    steps = plan(EMPTY, SOURCE, Request())
    assert set(written(steps)) >= {USERS, UNIT, UDEV_RULES, CONFIGURATION, CAMERA_FILE}
    assert kinds(steps, PointLink) == [
        PointLink(path=ENVIRONMENT, target=f"{HOME}/venv-1"), PointLink(path=COMMAND, target=PROGRAM),
    ]  # fmt: skip
    assert kinds(steps, Run)[0].command == ("systemd-sysusers", "fwav-companion.conf")
    assert kinds(steps, AwaitHeartbeat) == [AwaitHeartbeat()], "nothing to go back to"
    assert {type(step) for step in plan(done(steps, EMPTY), SOURCE, Request())} == {Remark}


def test_an_edited_configuration_is_left_alone_and_a_changed_unit_is_ours():
    there = done(plan(EMPTY, SOURCE, Request()), EMPTY)
    edited = {**there.texts, CONFIGURATION: SERIAL, CAMERA_FILE: "mine", UNIT: "older"}
    system = System(
        platform=ARM64, texts=edited, environment="venv-1", environments=("venv-1",), installed=there.installed
    )
    steps = plan(system, SOURCE, Request())
    assert set(written(steps)) == {UNIT, NETWORK_DROP_IN}
    assert written(steps)[UNIT] == SOURCE.files["fwav-companion.service"]
    assert not kinds(steps, MakeEnvironment)
    assert ("systemctl", "restart", "fwav-companion") in [step.command for step in kinds(steps, Run)]


@pytest.mark.parametrize(
    ("extras", "locks"),
    [
        ((), ["board.txt"]),
        (("terrain",), ["board-terrain.txt"]),
        (("terrain", "ulog"), ["board-terrain.txt", "board-ulog.txt"]),
    ],
)
def test_extras_come_from_their_lock_files(extras: tuple[str, ...], locks: list[str]):
    (made,) = kinds(plan(EMPTY, SOURCE, Request(extras=extras)), MakeEnvironment)
    assert made.extras == extras
    assert made.locks == tuple(f"/src/requirements/{name}" for name in [*locks, "build.txt"])


def test_an_extra_that_is_not_there_is_a_wrong_argument():
    with pytest.raises(UserError, match=r"--with onxx: no such extra; accepted: terrain, ulog"):
        plan(EMPTY, SOURCE, Request(extras=("onxx",)))


def test_extras_that_were_installed_stay_with_an_upgrade():
    there = done(plan(EMPTY, SOURCE, Request(extras=("terrain",))), EMPTY)
    (made,) = kinds(plan(there, SOURCE, Request(extras=("ulog",), upgrade=True)), MakeEnvironment)
    assert made.extras == ("terrain", "ulog")
    assert made.path == f"{HOME}/venv-2"


def test_an_upgrade_can_go_back_and_removes_the_environment_before_the_last():
    there = done(plan(EMPTY, SOURCE, Request()), EMPTY)
    system = System(
        platform=ARM64, texts={**there.texts, UNIT: "older"}, environment="venv-4", environments=("venv-3", "venv-4"),
        installed=there.installed,
    )  # fmt: skip
    steps = plan(system, SOURCE, Request(upgrade=True))
    (wait,) = kinds(steps, AwaitHeartbeat)
    back = list(wait.otherwise)
    assert back[0] == PointLink(path=ENVIRONMENT, target=f"{HOME}/venv-4")
    assert WriteFile(path=UNIT, content="older") in back
    assert back[-1] == RemovePath(path=f"{HOME}/venv-5")
    assert kinds(steps, RemovePath) == [RemovePath(path=f"{HOME}/venv-3")]
    assert steps.index(wait) < steps.index(RemovePath(path=f"{HOME}/venv-3"))


def test_an_environment_made_by_hand_is_kept_behind_a_link():
    system = System(platform=ARM64, environment="venv", environment_is_folder=True)
    steps = plan(system, SOURCE, Request())
    (renamed,) = kinds(steps, RenamePath)
    first, last, _ = kinds(steps, PointLink)
    assert (first.target, last.target) == (renamed.to, f"{HOME}/venv-1")
    (wait,) = kinds(steps, AwaitHeartbeat)
    assert wait.otherwise[0] == PointLink(path=ENVIRONMENT, target=renamed.to)


@pytest.mark.parametrize(
    ("platform", "small", "linux32"),
    [
        (Platform(name="linux-aarch64"), False, False),
        (Platform(name="linux-x86_64"), False, False),
        (Platform(name="linux-armv7l", pointer_bits=32), True, False),
        (Platform(name="linux-armv6l", pointer_bits=32), True, False),
        (Platform(name="linux-aarch64", pointer_bits=32), True, True),
    ],
)
def test_a_32_bit_system_is_that_of_the_interpreter(platform: Platform, small: bool, linux32: bool):
    steps = plan(System(platform=platform), SOURCE, Request())
    (made,) = kinds(steps, MakeEnvironment)
    assert (made.locks == (), made.linux32) == (small, linux32)
    assert any("32-bit" in step.text for step in kinds(steps, Remark)) == small


@pytest.mark.parametrize(("source_key", "sees"), [("libcamera:0", True), ("/dev/video0", False)])
def test_a_pi_camera_needs_the_packages_of_the_system(source_key: str, sees: bool):
    texts = {CONFIGURATION: f'{SERIAL}[camera]\ncalibration = "c.yaml"\n[vision]\nsource = "{source_key}"\n'}
    (made,) = kinds(plan(System(platform=ARM64, texts=texts), SOURCE, Request()), MakeEnvironment)
    assert made.system_packages == sees


def test_a_wrong_configuration_is_named_and_the_rest_is_done():
    steps = plan(System(platform=ARM64, texts={CONFIGURATION: "[vehicel]\n"}), SOURCE, Request())
    assert any("vehicel" in step.text for step in kinds(steps, Remark))
    assert UNIT in written(steps)


def link(url: str, more: str = "") -> str:
    return f'{SERIAL}[[link]]\nname = "ground"\nurl = "{url}"\nrole = "gcs"\n{more}'


def preview(address: str) -> str:
    return f'{SERIAL}[camera]\ncalibration = "c.yaml"\n[vision]\nsource = "/dev/video0"\npreview = "{address}"\n'


def fleet(lines: str) -> str:
    return f"{SERIAL}[fleet]\n{lines}\n"


@pytest.mark.parametrize(
    ("config", "allowed"),
    [
        (SERIAL, ["localhost"]),
        (link("udpout://10.1.2.3:14550"), ["localhost", "10.1.2.3/32"]),
        (link("udpout://[fd00::1]:14550"), ["localhost", "fd00::1/128"]),
        (link("udpbcast://192.168.4.255:14550"), ["localhost", "192.168.4.0/24"]),
        (link("udpin://127.0.0.1:14550"), ["localhost"]),
        (link("udpin://0.0.0.0:14550"), None),
        (link("udpout://station.local:14550"), None),
        (link("udpbcast://255.255.255.255:14550"), None),
        (link("tcpout://10.0.0.9:5760", '[publish]\ncot = "udpout://239.2.3.1:6969"\n'),
         ["localhost", "10.0.0.9/32", "239.2.3.1/32"]),
        (fleet('connect = ["tcp/10.0.0.1:7447", "tls/[fd00::2]:7447"]'), ["localhost", "10.0.0.1/32", "fd00::2/128"]),
        (fleet('connect = ["unixsock-stream//run/zenoh"]'), ["localhost"]),
        (fleet('connect = ["tcp/10.0.0.1:7447"]\nconfig = "zenoh.json5"'), ["localhost", "10.0.0.1/32"]),
        (fleet('connect = ["tcp/hub.local:7447"]'), None),
        (fleet('listen = ["tcp/0.0.0.0:7447"]'), None),
        (fleet("scouting = true"), None),
        (fleet('config = "zenoh.json5"'), None),
        (preview("127.0.0.1:8089"), ["localhost"]),
        (preview("0.0.0.0:8089/abcdefghijklmnop"), None),
    ],
)  # fmt: skip
def test_the_network_is_limited_to_the_configured_links(config: str, allowed: list[str] | None):
    texts = {CONFIGURATION: config, NETWORK_DROP_IN: "of other links"}
    steps = plan(System(platform=ARM64, texts=texts), SOURCE, Request())
    if allowed is None:
        assert RemovePath(path=NETWORK_DROP_IN) in steps
        return
    lines = written(steps)[NETWORK_DROP_IN].splitlines()
    assert "IPAddressDeny=any" in lines
    assert [line.removeprefix("IPAddressAllow=") for line in lines if "Allow" in line] == allowed


def test_uninstall_leaves_configuration_and_recordings():
    there = done(plan(EMPTY, SOURCE, Request()), EMPTY)
    steps = plan(there, SOURCE, Request(uninstall=True))
    removed = {step.path for step in kinds(steps, RemovePath)}
    assert {UNIT, UDEV_RULES, USERS, HOME} <= removed
    assert not any(path.startswith(("/etc/fwav-companion", "/var")) for path in removed)


@pytest.mark.parametrize("there", ["", "/home/pi/fwav/bin/fwav-companion"])
def test_a_command_of_that_name_that_is_not_ours_is_left_alone(there: str):
    system = System(platform=ARM64, command=there)
    steps = plan(system, SOURCE, Request())
    assert COMMAND not in {step.path for step in kinds(steps, PointLink)}
    assert any(step.text.startswith(f"{COMMAND} is yours") for step in kinds(steps, Remark))
    assert COMMAND not in {step.path for step in kinds(plan(system, SOURCE, Request(uninstall=True)), RemovePath)}


def test_the_command_goes_with_the_program():
    there = done(plan(EMPTY, SOURCE, Request()), EMPTY)
    removed = {step.path for step in kinds(plan(there, SOURCE, Request(uninstall=True)), RemovePath)}
    assert COMMAND in removed


def test_the_source_is_this_checkout():
    found = source()
    assert Path(found.path, "pyproject.toml").is_file()
    assert "terrain" in found.extras
    assert "test" not in found.extras


# The serial port of a Raspberry Pi.

ZERO_2 = "Raspberry Pi Zero 2 W Rev 1.0"
CMDLINE = "console=serial0,115200 console=tty1 root=PARTUUID=ab-02 rootwait\n"


def on_a_pi(model: str, cmdline: str, config_txt: str, *, boot: bool, device: str = "/dev/serial0") -> list[Step]:
    texts = {
        CONFIGURATION: SERIAL.replace("/dev/serial0", device),
        "/boot/firmware/cmdline.txt": cmdline,
        "/boot/firmware/config.txt": config_txt,
    }
    return plan(System(platform=ARM64, texts=texts, model=model), SOURCE, Request(boot=boot))


def problems(steps: list[Step]) -> list[str]:
    return [step.text for step in kinds(steps, Remark) if step.text.startswith("/dev/")]


def test_console_uart_and_bluetooth_are_named_and_boot_files_stay():
    steps = on_a_pi(ZERO_2, CMDLINE, "[pi4]\nenable_uart=1\n", boot=False)
    found = problems(steps)
    assert len(found) == 3
    assert "console=serial0,115200" in found[0]
    assert "enable_uart=1" in found[1]
    assert "disable-bt" in found[2]
    assert not any(path.startswith("/boot") for path in written(steps))


def test_boot_frees_the_port_keeps_copies_and_ends():
    steps = on_a_pi(ZERO_2, CMDLINE, "dtparam=audio=on\n", boot=True)
    new = written(steps)
    assert new["/boot/firmware/cmdline.txt"] == "console=tty1 root=PARTUUID=ab-02 rootwait\n"
    keeps = {step.path: step.keep for step in kinds(steps, WriteFile) if step.path.startswith("/boot")}
    assert keeps == {path: f"{path}.before-fwav-companion" for path in keeps}
    again = on_a_pi(ZERO_2, new["/boot/firmware/cmdline.txt"], new["/boot/firmware/config.txt"], boot=True)
    assert problems(again) == []
    assert not any(path.startswith("/boot") for path in written(again))


@pytest.mark.parametrize(
    ("model", "config_txt", "device", "words"),
    [
        ("Raspberry Pi 3 Model B Rev 1.2", "enable_uart=1\ndtoverlay=miniuart-bt\n", "/dev/ttyAMA0", []),
        ("Raspberry Pi Zero Rev 1.3", "enable_uart=1\n", "/dev/serial0", []),
        ("Raspberry Pi 4 Model B Rev 1.4", "enable_uart = 1 # GPS\n", "/dev/serial0", ["Bluetooth"]),
        ("Raspberry Pi 5 Model B Rev 1.0", "", "/dev/serial0", ["debug connector", "uart0=on"]),
        ("Raspberry Pi 5 Model B Rev 1.0", "dtparam=uart0=on\n", "/dev/ttyAMA0", []),
        ("Raspberry Pi 4 Model B Rev 1.4", "", "/dev/ttyUSB0", []),
    ],
)
def test_only_what_is_in_the_way_on_this_model(model: str, config_txt: str, device: str, words: list[str]):
    found = problems(on_a_pi(model, "console=tty1\n", config_txt, boot=False, device=device))
    assert len(found) == len(words)
    assert all(word in text for word, text in zip(words, found, strict=True))
