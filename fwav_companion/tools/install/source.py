"""SHELL: finds the program to install: the checkout that runs this command, or the installed package."""

from __future__ import annotations

import base64
import hashlib
import re
import tomllib
import zipfile
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path
from typing import Final

from fwav_companion import __version__
from fwav_companion.errors import UserError
from fwav_companion.on_disk import content
from fwav_companion.tools.install.system import Package

PACKAGE: Final = Path(__file__).resolve().parents[2]
BOARD_FILES: Final = ("fwav-companion.service", "99-fwav-companion.rules", "fwav-companion.toml")
NOT_COPIED: Final = frozenset({"RECORD", "INSTALLER", "REQUESTED", "direct_url.json"})
"""Files of a dist-info folder that an installer writes."""


def source() -> Package:
    """Return the program to install. UserError if its files for a board are missing."""
    checkout = PACKAGE.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / "systemd").is_dir():
        folder, path = checkout / "systemd", str(checkout)
        extras = tomllib.loads((checkout / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        locks = checkout / "requirements"
    else:
        folder, path, locks = PACKAGE / "tools" / "install" / "board", "", PACKAGE / "tools" / "install" / "board"
        extras = installed_package().metadata.get_all("Provides-Extra") or []
    try:
        texts = {name: content(folder / name).decode() for name in BOARD_FILES}
    except OSError as error:
        raise UserError(f"install: {error.filename}: {error.strerror}; accepted: a complete package") from None
    texts["camera.yaml"] = (files("fwav_companion.cli.templates") / "camera.yaml").read_text(encoding="utf-8")
    return Package(
        version=__version__,
        path=path,
        extras=tuple(sorted(extra for extra in extras if extra not in ("test", "lint", "lock"))),
        locks={each.name: str(each) for each in sorted(locks.glob("*.txt"))},
        files=texts,
    )


def write_wheel(folder: Path, package: Distribution) -> Path:
    """Write a wheel of an installed package, with its metadata and entry points, and return its path."""
    name = f"fwav_companion-{package.version}-py3-none-any.whl"
    rows = []
    with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path in package.files or ():
            if ".." in path.parts or "__pycache__" in path.parts or path.name in NOT_COPIED:
                continue
            data = Path(str(path.locate())).read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
            rows.append(f"{path},sha256={digest},{len(data)}")
            wheel.writestr(str(path), data)
        record = f"fwav_companion-{package.version}.dist-info/RECORD"
        wheel.writestr(record, "\n".join([*rows, f"{record},,", ""]))
    return folder / name


def installed_package() -> Distribution:
    """Return the installed package that runs this command. UserError where it was not installed."""
    try:
        return distribution("fwav-companion")
    except PackageNotFoundError:
        raise UserError(
            "install: this program was not installed by pip; accepted: a checkout, or pip install"
        ) from None


def is_environment_name(name: str) -> bool:
    """Return whether a folder's name is one that `install` gives to an environment."""
    return re.fullmatch(r"venv-\d+", name) is not None
