"""Installs MAVProxy into an environment of its own: its dependencies take a gigabyte that a headless station does not
need.
"""

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PINNED = ("MAVProxy==1.8.75", "pymavlink==2.4.50", "pyserial==3.5", "fastcrc==0.5.0")
"""Packages that a headless MAVProxy imports; installed without their declared dependencies."""


@pytest.fixture(scope="session")
def mavproxy() -> tuple[str, str]:
    """The command that starts MAVProxy. It is installed once from PyPI and kept in the user's cache."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fwav-companion-tests"
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    home = cache / f"{'-'.join(PINNED)}-python{version}".replace("==", "-")
    cache.mkdir(parents=True, exist_ok=True)
    with (cache / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (home / "complete").exists():
            shutil.rmtree(home, ignore_errors=True)
            subprocess.run([sys.executable, "-m", "venv", home], check=True, timeout=120)
            install = [home / "bin/python", "-m", "pip", "install", "--quiet", "--no-deps", *PINNED]
            subprocess.run(install, check=True, timeout=300)
            (home / "complete").touch()
    return str(home / "bin/python"), str(home / "bin/mavproxy.py")
