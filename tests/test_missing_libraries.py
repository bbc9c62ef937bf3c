"""A library that is not installed is one line with the command that installs it, before any work is done."""

import subprocess
import sys
from pathlib import Path

import pytest
from flying import fly

from fwav_companion.cli import init
from fwav_companion.cli.main import main
from fwav_companion.errors import UserError
from fwav_companion.libraries import EXTRAS, WITHOUT_WHEEL, advice
from fwav_companion.recording.ulog import HEAD, read_ulog
from fwav_companion.service.elevation_files import read_elevation
from sitl_mock import scenario

PREPARED = (
    'import sys\nsys.modules.update(dict.fromkeys("{missing}".split()))\n'
    "from fwav_companion.cli.main import main\nsys.exit(main(sys.argv[1:]))"
)
"""A process of its own in which some modules cannot be imported."""


def without(missing: str, *words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    code = PREPARED.format(missing=missing)
    return subprocess.run([sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True, timeout=60)


def refused(done: subprocess.CompletedProcess[str]) -> str:
    """The single line on stderr."""
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    return done.stderr.removeprefix("fwav-companion: ").removesuffix("\n")


@pytest.mark.parametrize(
    ("words", "missing", "reported"),
    [
        ("calibrate . --board chessboard:9x6:25mm --out o.yaml", "cv2", "calibrate: cv2 is"),
        ("calibrate . --board chessboard:9x6:25mm --out o.yaml", "numpy", "calibrate: numpy is"),
        (
            "calibrate . --board chessboard:9x6:25mm --out o.yaml --report r",
            "matplotlib",
            "calibrate --report: matplot",
        ),
        ("demo", "cv2", "demo: cv2 is"),
        ("paper", "numpy", "paper: numpy is"),
        ("check --config c.toml --shake --tag-size 0.16", "scipy", "check --shake: scipy is"),
        (
            "check --config c.toml --shake --tag-size 0.16",
            "cv2 numpy scipy",
            "check --shake: cv2 and numpy and scipy are",
        ),
        ("run --config c.toml", "cv2", "c.toml: [vision]: cv2 is"),
    ],
)
def test_a_command_that_cannot_work_says_what_it_lacks(words: str, missing: str, reported: str, tmp_path: Path):
    assert main(["init", str(tmp_path)]) == 0
    config = (tmp_path / "fwav-companion.toml").read_text()
    (tmp_path / "c.toml").write_text(config + '[vision]\nsource = "/dev/video0"\n')
    line = refused(without(missing, *words.split(), folder=tmp_path))
    assert line.startswith(reported)
    assert "pip install '.[demo]'" in line if missing == "matplotlib" else "run pip install . in" in line


def test_without_any_of_them_a_flight_is_served_checked_and_replayed(tmp_path: Path):
    """A 32-bit board with another program's detections."""
    flown = fly(scenario("unbiased").but({"seconds": 12.0, "seed": 6}))
    assert main(["init", str(tmp_path)]) == 0
    (tmp_path / "telemetry.tlog").write_bytes(flown.companion.tlog)
    (tmp_path / "detections.jsonl").write_bytes(flown.companion.detections)
    code = (
        f"import sys\nsys.modules.update(dict.fromkeys({[*sorted(WITHOUT_WHEEL), *EXTRAS]!r}))\n"
        "from fwav_companion.cli.main import main\nfrom fwav_companion.config import load\n"
        "from fwav_companion.service.configured_files import load_calibration\n"
        "from fwav_companion.service.daemon import Service\n"
        "import fwav_companion.tools.doctor.examination, fwav_companion.tools.doctor.gathering\n"
        "config = load('fwav-companion.toml')\n"
        "Service(config, load_calibration(config), None, elevation=(), extra_files={})\n"
        "words = ['--telemetry', 'telemetry.tlog', '--detections', 'detections.jsonl', '--out', 'targets.jsonl']\n"
        "sys.exit(main(['replay', *words, '--config', 'fwav-companion.toml', '--report', 'report']))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "report/report.html").exists()


def test_a_file_whose_reader_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for module in ("rasterio", "pyulog"):
        monkeypatch.setitem(sys.modules, module, None)
    tile, log = tmp_path / "dem.tif", tmp_path / "log.ulg"
    tile.write_bytes(b"II*\0")
    log.write_bytes(HEAD)
    with pytest.raises(UserError, match=r"dem.tif: .*rasterio is not installed; run pip install '.\[terrain\]'"):
        read_elevation([tile])
    with pytest.raises(UserError, match=r"log.ulg: .*pyulog is not installed; run pip install '.\[ulog\]'"):
        read_ulog(log)


def test_one_that_no_command_asked_for_in_time_is_one_line_too(monkeypatch, capsys):
    def fails(_arguments: object) -> int:
        raise ModuleNotFoundError(name="scipy.optimize")

    monkeypatch.setattr(init, "run", fails)
    assert main(["init"]) == 2
    assert capsys.readouterr().err == f"fwav-companion: {advice('scipy')}\n"


def test_a_module_of_our_own_that_is_missing_is_our_mistake(monkeypatch):
    def fails(_arguments: object) -> int:
        raise ModuleNotFoundError(name="fwav_companion.absent")

    monkeypatch.setattr(init, "run", fails)
    with pytest.raises(ModuleNotFoundError):
        main(["init"])


def test_the_line_says_where_there_are_no_wheels():
    assert advice("cv2", "numpy.linalg") == (
        "cv2 and numpy are not installed; run pip install . in the project's folder (32-bit systems cannot have it: "
        "they relay, and take detections by UDP)"
    )
    assert "32-bit" not in advice("pyulog")
