"""SHELL: reads the state of a board, from its root or from a folder of files. Reads only."""

from __future__ import annotations

import shutil
import struct
import sysconfig
from os.path import normpath
from pathlib import Path, PurePosixPath

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.tools.install.source import is_environment_name
from fwav_companion.tools.install.system import (
    BOOT_FOLDERS,
    CAMERA_FILE,
    COMMAND,
    CONFIGURATION,
    ENVIRONMENT,
    HOME,
    NETWORK_DROP_IN,
    RECORD,
    UDEV_RULES,
    UNIT,
    USERS,
    Installed,
    Platform,
    System,
)

JUDGED = (
    CAMERA_FILE,
    CONFIGURATION,
    NETWORK_DROP_IN,
    RECORD,
    UDEV_RULES,
    UNIT,
    USERS,
    *(f"{folder}/{name}" for folder in BOOT_FOLDERS for name in ("cmdline.txt", "config.txt")),
)
MODEL = "/proc/device-tree/model"


def observed(root: Path) -> System:
    """Return the state of the board. InputFileError if a required file cannot be read."""
    texts = {path: text for path in JUDGED if (text := _text(below(root, path))) is not None}
    link = below(root, ENVIRONMENT)
    home = below(root, HOME)
    names = sorted(each.name for each in home.iterdir() if is_environment_name(each.name)) if home.is_dir() else []
    model = (_text(below(root, MODEL)) or "").strip("\0\n")
    is_folder = link.is_dir() and not link.is_symlink()
    return System(
        platform=Platform(name=sysconfig.get_platform(), pointer_bits=8 * struct.calcsize("P")),
        root=str(root),
        texts=texts,
        environment=link.name if is_folder else _target(link),
        environment_is_folder=is_folder,
        environments=tuple(names),
        command=_pointed(below(root, COMMAND), COMMAND),
        installed=_installed(texts.get(RECORD)),
        model=model if "Raspberry Pi" in model else "",
        has_systemd=shutil.which("systemctl") is not None and Path("/run/systemd/system").is_dir(),
    )


def below(root: Path, path: str) -> Path:
    """Return an absolute path of the board below the root."""
    return root / path.lstrip("/")


def _text(path: Path) -> str | None:
    try:
        return path.read_text(errors="replace")
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a readable file (sudo)") from None


def _target(link: Path) -> str:
    """Return the name of the folder that the link points to; "" if it does not exist."""
    if not link.is_symlink():
        return ""
    name = link.readlink().name
    return name if (link.parent / name).is_dir() else ""


def _pointed(link: Path, path: str) -> str | None:
    """Return the path on the board that the link points to, "" if it is a file; None if there is neither."""
    if link.is_symlink():
        return normpath(PurePosixPath(path).parent / link.readlink())
    return "" if link.exists() else None


def _installed(record: str | None) -> Installed | None:
    try:
        return None if record is None else msgspec.json.decode(record, type=Installed)
    except (msgspec.MsgspecError, UnicodeError):
        return None
