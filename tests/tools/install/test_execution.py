"""The steps done in a tree of directories: as root and not, broken off in the middle, and back after a bad upgrade."""

import json
import os
import subprocess
import sys
import time
import zipfile
from collections.abc import Sequence
from importlib.metadata import Distribution
from pathlib import Path

import pytest

from fwav_companion.cli.main import main
from fwav_companion.tools.install.execution import Execution, StepError, require_root
from fwav_companion.tools.install.observing import observed
from fwav_companion.tools.install.source import write_wheel
from fwav_companion.tools.install.steps import AwaitHeartbeat, MakeEnvironment, PointLink, RemovePath, Run, WriteFile
from fwav_companion.tools.install.system import ENVIRONMENT, HOME, STATUS, UNIT


class Commands:
    """Commands that are recorded; `venv` makes a bare environment, programs named in ``fails`` fail."""

    def __init__(self, *fails: str) -> None:
        self.ran: list[list[str]] = []
        self._fails = fails

    def __call__(self, command: Sequence[str]) -> int:
        self.ran.append(list(command))
        if command[1:3] == ["-m", "venv"]:
            scripts = Path(command[-1]) / "bin"
            scripts.mkdir(parents=True)
            (scripts / "fwav-companion").write_text(f"#!{scripts}/python\n")
        return 1 if any(word in command for word in self._fails) else 0


def in_tree(root: Path, commands: Commands, **options: float) -> tuple[Execution, list[str]]:
    lines: list[str] = []
    return Execution(root, command=commands, say=lines.append, **options), lines


def status(root: Path, started_s: float, up_s: float, faults: int = 0) -> None:
    path = root / STATUS.lstrip("/")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"time_monotonic": started_s + up_s, "up_s": up_s, "internal_faults": faults}))


def test_an_environment_in_a_root_has_the_addresses_of_the_board(tmp_path: Path):
    commands = Commands()
    execution, _ = in_tree(tmp_path, commands)
    execution.do([MakeEnvironment(path=f"{HOME}/venv-1", source="/src", extras=("terrain",)),
                  PointLink(path=ENVIRONMENT, target=f"{HOME}/venv-1")])  # fmt: skip
    assert commands.ran[-1][-1] == "/src[terrain]"
    script = tmp_path / "opt/fwav-companion/venv/bin/fwav-companion"
    assert script.read_text() == "#!/opt/fwav-companion/venv-1/bin/python\n"
    assert observed(tmp_path).environment == "venv-1"


def test_locked_libraries_come_first_and_the_program_without_any(tmp_path: Path):
    commands = Commands()
    in_tree(tmp_path, commands)[0].do(
        [MakeEnvironment(path=f"{HOME}/venv-1", source="/src", locks=("/r/board.txt", "/r/build.txt"), linux32=True)]
    )
    first, second = commands.ran[1:]
    assert first[0] == "linux32"
    assert first[-5:] == [":all:", "-r", "/r/board.txt", "-r", "/r/build.txt"]
    assert "--require-hashes" in first
    assert second[-3:] == ["--no-deps", "--no-build-isolation", "/src"]


def test_a_failed_environment_leaves_none_and_the_old_one_in_use(tmp_path: Path):
    execution, _ = in_tree(tmp_path, Commands())
    steps = [
        MakeEnvironment(path=f"{HOME}/venv-1", source="/src"),
        PointLink(path=ENVIRONMENT, target=f"{HOME}/venv-1"),
    ]
    execution.do(steps)
    failing, _ = in_tree(tmp_path, Commands("pip"))
    with pytest.raises(StepError, match="pip install"):
        failing.do([MakeEnvironment(path=f"{HOME}/venv-2", source="/src"), RemovePath(path=f"{HOME}/venv-1")])
    assert observed(tmp_path).environments == ("venv-1",)
    assert observed(tmp_path).environment == "venv-1"


def test_an_upgrade_without_a_heartbeat_goes_back(tmp_path: Path):
    execution, _ = in_tree(tmp_path, Commands(), heartbeat_s=0.0)
    for name in ("venv-1", "venv-2"):
        execution.do(
            [
                MakeEnvironment(path=f"{HOME}/{name}", source="/src"),
                PointLink(path=ENVIRONMENT, target=f"{HOME}/{name}"),
            ]
        )
    back = (
        PointLink(path=ENVIRONMENT, target=f"{HOME}/venv-1"),
        WriteFile(path=UNIT, content="older"),
        RemovePath(path=f"{HOME}/venv-2"),
    )
    with pytest.raises(StepError, match="the old environment is back"):
        execution.do([AwaitHeartbeat(otherwise=back)])
    found = observed(tmp_path)
    assert (found.environment, found.environments, found.texts[UNIT]) == ("venv-1", ("venv-1",), "older")


@pytest.mark.parametrize(
    ("started_after_s", "up_s", "faults", "came"),
    [(1.0, 3.0, 0, True), (-60.0, 61.0, 0, False), (1.0, 1.0, 0, False), (1.0, 3.0, 2, False)],
)
def test_a_heartbeat_is_that_of_the_service_started_now(
    tmp_path: Path, started_after_s: float, up_s: float, faults: int, came: bool
):
    execution, _ = in_tree(tmp_path, Commands(), heartbeat_s=0.1)
    status(tmp_path, time.monotonic() + started_after_s, up_s, faults)
    if came:
        execution.do([AwaitHeartbeat()])
    else:
        with pytest.raises(StepError, match="journalctl"):
            execution.do([AwaitHeartbeat()])


def test_the_copy_of_a_boot_file_is_that_of_the_first_time(tmp_path: Path):
    path = tmp_path / "boot/firmware/config.txt"
    path.parent.mkdir(parents=True)
    path.write_text("original")
    execution, _ = in_tree(tmp_path, Commands())
    for content in ("first", "second"):
        execution.do(
            [WriteFile(path="/boot/firmware/config.txt", content=content, keep="/boot/firmware/config.txt.old")]
        )
    assert path.read_text() == "second"
    assert path.with_name("config.txt.old").read_text() == "original"


def test_an_optional_command_that_is_missing_is_reported_and_the_rest_is_done(tmp_path: Path):
    lines: list[str] = []
    execution = Execution(tmp_path, say=lines.append)
    missing = ("/nowhere/systemd-analyze", "verify")
    execution.do([Run(command=missing, optional=True), WriteFile(path="/etc/after", content="x")])
    assert any(line.startswith("WARNING /nowhere/systemd-analyze") for line in lines)
    assert (tmp_path / "etc/after").is_file()
    with pytest.raises(StepError, match="no such program"):
        execution.do([Run(command=missing)])


def test_only_root_changes_the_board_itself(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(Exception, match="only root"):
        require_root(Path("/"), dry=False)
    require_root(Path("/"), dry=True)
    require_root(tmp_path, dry=False)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    require_root(Path("/"), dry=False)


def test_a_dry_run_changes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["install", "--root", str(tmp_path), "--dry-run"]) == 0
    assert list(tmp_path.iterdir()) == []
    assert "write /etc/systemd/system/fwav-companion.service" in capsys.readouterr().out


def test_another_user_than_root_installs_into_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The whole command, with pip replaced: no network in tests."""
    from fwav_companion.tools.install import execution

    commands = Commands()
    monkeypatch.setattr(execution.Execution.__init__, "__kwdefaults__",
                        {**execution.Execution.__init__.__kwdefaults__, "command": commands})  # fmt: skip
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert main(["install", "--root", str(tmp_path)]) == 0
    first = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
    commands.ran.clear()
    command = tmp_path / "usr" / "local" / "bin" / "fwav-companion"
    assert command.readlink() == Path("../../../opt/fwav-companion/venv/bin/fwav-companion")
    assert main(["install", "--root", str(tmp_path)]) == 0
    assert commands.ran == [], "the second run changes nothing"
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()} == first
    assert main(["install", "--root", str(tmp_path), "--uninstall"]) == 0
    left = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert not command.is_symlink()
    assert left == {"etc/fwav-companion/fwav-companion.toml", "etc/fwav-companion/camera.yaml"}


def test_the_wheel_of_an_installed_package_is_one_that_pip_installs(tmp_path: Path):
    """Without an index; the installer's own files, caches and scripts stay behind, the entry points do not."""
    before = tmp_path / "before"
    info = before / "fwav_companion-9.9.dist-info"
    made = {
        "fwav_companion/__init__.py": "VALUE = 7\n",
        "fwav_companion/__pycache__/x.pyc": "old",
        f"{info.name}/METADATA": "Metadata-Version: 2.1\nName: fwav-companion\nVersion: 9.9\n",
        f"{info.name}/WHEEL": "Wheel-Version: 1.0\nGenerator: x\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info.name}/entry_points.txt": "[console_scripts]\nfwav-companion = fwav_companion:main\n",
        f"{info.name}/direct_url.json": "{}",
    }
    for name, text in made.items():
        (before / name).parent.mkdir(parents=True, exist_ok=True)
        (before / name).write_text(text)
    (info / "RECORD").write_text("".join(f"{name},,\n" for name in [*made, "../../bin/fwav-companion"]))
    wheel = write_wheel(tmp_path, Distribution.at(info))
    after = tmp_path / "after"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--target", str(after)]
    subprocess.run([*pip, str(wheel)], check=True, timeout=120)
    assert (after / "fwav_companion/__init__.py").read_text() == "VALUE = 7\n"
    assert (after / "bin/fwav-companion").is_file()
    with zipfile.ZipFile(wheel) as packed:
        assert not any("__pycache__" in name or "direct_url" in name for name in packed.namelist())
