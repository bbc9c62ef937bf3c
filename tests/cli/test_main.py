"""The command line: exit statuses, one-line errors, and imports: a command does not load another command's
libraries.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import fwav_companion
from fwav_companion.cli import init
from fwav_companion.cli.main import COMMANDS, main
from fwav_companion.config import load
from fwav_companion.errors import ConfigError


def run(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fwav_companion", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=cwd)


def test_version(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"fwav-companion {fwav_companion.__version__}\n"


def test_help_lists_what_is_there(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = capsys.readouterr().out
    here = Path(init.__file__).parent
    for command in COMMANDS:
        assert (f"    {command.name} " in shown) == (here / f"{command.name}.py").exists()
    assert "example:" in shown


def test_help_of_a_command_shows_an_example(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        main(["init", "--help"])
    assert caught.value.code == 0
    assert "example:\n  fwav-companion init" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [[], ["fly"], ["init", "--fast"], ["init", "a", "b"]])
def test_wrong_usage_is_one_line_and_status_2(arguments: list[str], capsys: pytest.CaptureFixture[str]):
    assert main(arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("fwav-companion: ")
    assert shown.err.count("\n") == 1


def test_a_file_name_that_is_not_utf8_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Such a name fits into no line of JSON: status, recordings and reports all hold the names of files."""
    assert main(["run", "--config", os.fsdecode(b"fl\xfcge.toml")]) == 2
    said = "fl\N{REPLACEMENT CHARACTER}ge.toml: it has bytes that are not UTF-8; accepted: a name in UTF-8"
    assert capsys.readouterr().err == f"fwav-companion: {said}\n"


def test_a_working_folder_that_is_not_utf8_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    folder = tmp_path / os.fsdecode(b"fl\xfcge")
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert main(["init"]) == 2
    assert "ge: it has bytes that are not UTF-8" in capsys.readouterr().err
    assert not list(folder.iterdir())


def test_an_unknown_option_names_the_help_of_its_command(capsys: pytest.CaptureFixture[str]):
    assert main(["init", "--fast"]) == 2
    assert "--fast (see fwav-companion init --help)" in capsys.readouterr().err


def test_a_replay_without_input_names_both_ways(capsys: pytest.CaptureFixture[str]):
    assert main(["replay"]) == 2
    said = capsys.readouterr().err
    assert "--telemetry, --detections, --config, --out, or a recording's FOLDER and --out" in said


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (ConfigError("f.toml: wrong"), 2, "fwav-companion: f.toml: wrong\n"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_how_a_command_ends(
    error: BaseException,
    status: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    def fails(_arguments: object) -> int:
        raise error

    monkeypatch.setattr(init, "run", fails)
    assert main(["init"]) == status
    assert capsys.readouterr().err == said


def test_a_mistake_of_ours_is_not_hidden(monkeypatch: pytest.MonkeyPatch):
    def fails(_arguments: object) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(init, "run", fails)
    with pytest.raises(ZeroDivisionError):
        main(["init"])


def test_a_reader_that_has_seen_enough_gets_no_traceback(tmp_path: Path):
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "fwav_companion", "init", str(tmp_path)]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, timeout=60)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, b"")


def test_a_disk_that_is_full_under_the_output_is_one_line(tmp_path: Path):
    command = [sys.executable, "-m", "fwav_companion", "init", str(tmp_path)]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60)
    assert (done.returncode, done.stderr) == (1, b"fwav-companion: output: No space left on device\n")


def test_a_closed_output_is_not_an_error(tmp_path: Path):
    command = ["sh", "-c", 'exec "$0" "$@" >&-', sys.executable, "-m", "fwav_companion", "init", str(tmp_path)]
    done = subprocess.run(command, stderr=subprocess.PIPE, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_terminal_without_a_letter_gets_a_question_mark(tmp_path: Path):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "fwav_companion", "init", str(tmp_path / "größe")]
    done = subprocess.run(command, capture_output=True, timeout=60, env=environment)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"/gr??e/fwav-companion.toml" in done.stdout


def test_init_writes_what_can_be_loaded_and_overwrites_nothing(tmp_path: Path):
    folder = tmp_path / "new" / "folder"
    done = run("init", str(folder))
    assert (done.returncode, done.stderr) == (0, "")
    config = load(folder / "fwav-companion.toml")
    config.require_links()
    assert config.calibration_path.read_text() == init.template("camera.yaml")

    (folder / "fwav-companion.toml").write_text("mine")
    again = run("init", str(folder))
    assert again.returncode == 2
    assert again.stderr == (
        f"fwav-companion: {folder}/fwav-companion.toml: it exists already; accepted: a folder without it\n"
    )
    assert (folder / "fwav-companion.toml").read_text() == "mine"


def test_init_here_by_default_and_all_or_nothing(tmp_path: Path):
    (tmp_path / "camera.yaml").write_text("mine")
    assert run("init", cwd=tmp_path).returncode == 2
    assert [path.name for path in tmp_path.iterdir()] == ["camera.yaml"]
    (tmp_path / "camera.yaml").unlink()
    assert run("init", cwd=tmp_path).returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.yaml", "fwav-companion.toml"]


def test_init_in_a_folder_without_write_permission(tmp_path: Path):
    (tmp_path / "file").write_text("")
    done = run("init", str(tmp_path / "file"))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "accepted: a folder to write to" in done.stderr


@pytest.mark.parametrize("name", ["n" * 300, "ring", "two\nlines/" + "n" * 300])
def test_init_where_no_folder_can_be(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("ring").symlink_to("ring")
    assert main(["init", name]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.endswith("; accepted: a folder to write to\n")


@pytest.mark.parametrize("command", ["paper", "demo"])
@pytest.mark.parametrize(("name", "why"), [("file", "Not a directory"), ("ring", "Too many levels of symbolic links")])
def test_a_folder_that_cannot_be_is_one_line(command, name, why, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("ring").symlink_to("ring")
    Path("file").touch()
    assert main([command, "--out", name]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith("fwav-companion: ")
    assert f"{name}: {why}; accepted: a folder to write to" in said


@pytest.mark.parametrize("command", ["paper", "demo"])
@pytest.mark.parametrize("seed", ["-1", "1.5", "²", "9" * 5000])
def test_a_seed_that_is_none_is_one_line(command, seed, capsys):
    assert main([command, "--seed", seed]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"fwav-companion: argument --seed: {seed}: accepted: a whole number from 0, of at most 18")
    assert said.count("\n") == 1


def test_init_loads_nothing_of_other_commands():
    code = (
        "import sys\nfrom fwav_companion.cli.main import main\nmain(['init', '/proc/nowhere'])\n"
        "print(sorted({'rich', 'numpy', 'pymavlink', 'serial', 'asyncio'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "[]\n"
