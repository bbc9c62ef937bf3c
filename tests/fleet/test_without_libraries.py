"""What a service loads without [fleet], and what a machine without the libraries is told."""

from __future__ import annotations

import subprocess
import sys

import pytest

BLOCKED = "import sys; sys.modules.update(dict.fromkeys({names!r})); from fwav_companion.cli.main import main; "
LOADED = (
    "import sys; import fwav_companion.service.daemon, fwav_companion.cli.main; "
    "print(*(name for name in sys.modules if name.split('.')[0] in ('zenoh', 'aiohttp') "
    "or name.startswith(('fwav_companion.ground', 'fwav_companion.fleet.bus'))))"
)
FLEET = '[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:1"\nrole = "autopilot"\n[detections]\nurl = ""\n[fleet]\n'


def python(code: str, folder) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=120)


def test_the_daemon_without_a_fleet_loads_neither_bus_nor_page(tmp_path):
    assert python(LOADED, tmp_path).stdout.strip() == ""


@pytest.mark.parametrize(
    ("words", "names", "extra"),
    [
        (["run", "--config", "f.toml"], ["zenoh"], "fleet"),
        (["ground", "--link", "udpin://127.0.0.1:1"], ["aiohttp"], "ground"),
        (["ground", "--fleet", "f"], ["zenoh"], "fleet"),
        (["demo", "--fleet", "3"], ["zenoh"], "fleet"),
    ],
)
def test_a_missing_library_is_one_line_with_the_command_that_installs_it(tmp_path, words, names, extra):
    (tmp_path / "f.toml").write_text(FLEET)
    done = python(BLOCKED.format(names=names) + f"sys.exit(main({words!r}))", tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"pip install '.[{extra}]'" in done.stderr


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ('name = "a b"', "[fleet] name"),
        ('vehicle = "a/b"', "[fleet] vehicle"),
        ("rate_hz = 100", "[fleet] rate_hz"),
        ("gnss_shared_m = -1", "[fleet] gnss_shared_m"),
        ('connect = ["nonsense"]', "nonsense"),
    ],
)
def test_a_wrong_key_is_one_line(tmp_path, line, word):
    pytest.importorskip("zenoh")
    (tmp_path / "f.toml").write_text(FLEET + line + "\n")
    words = ["run", "--config", "f.toml"]
    done = python(f"import sys; from fwav_companion.cli.main import main; sys.exit(main({words!r}))", tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert word in done.stderr
    assert "accepted" in done.stderr
