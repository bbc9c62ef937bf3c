"""The wheel and the sdist: the same sources build to the same bytes, whatever the time and the folder."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGED = ("pyproject.toml", "README.md", "LICENSE", "fwav_companion", "sitl_mock", "systemd", "requirements")


def built(folder: Path, epoch: int) -> dict[str, str]:
    """SHA-256 of the files that a copy of the checkout builds to, by their names."""
    source = folder / "source"
    source.mkdir(parents=True)
    for name in PACKAGED:
        subprocess.run(["cp", "-r", str(ROOT / name), str(source)], check=True)
    for cache in source.rglob("__pycache__"):
        subprocess.run(["rm", "-r", str(cache)], check=True)
    for path in source.rglob("*"):
        os.utime(path, (epoch, epoch))
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--directory", str(folder / "dist")],
        check=True, cwd=source, env={**os.environ, "SOURCE_DATE_EPOCH": "1790000000"}, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (folder / "dist").iterdir()}


@pytest.mark.skipif(not (ROOT / "fwav_companion").exists(), reason="needs the sources: a checkout")
def test_same_sources_build_to_the_same_bytes_at_any_time(tmp_path: Path) -> None:
    first, second = built(tmp_path / "a", 1_600_000_000), built(tmp_path / "another folder", 1_700_000_000)
    assert sorted(Path(name).suffix for name in first) == [".gz", ".whl"]
    assert first == second
    (wheel,) = (tmp_path / "a" / "dist").glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert "fwav_companion/tools/install/board/board-all.txt" in names
    assert not [name for name in names if name.startswith("tests/")]
