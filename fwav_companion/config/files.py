"""SHELL: opens the configuration file, and the signing key that it names."""

from __future__ import annotations

import stat
from collections.abc import Iterable
from pathlib import Path

from fwav_companion.config.document import Config
from fwav_companion.config.reading import parse
from fwav_companion.errors import ConfigError
from fwav_companion.on_disk import open_regular

KEY_BYTES = 32
LARGEST_FILE_BYTES = 1 << 20
"""Largest size of a configuration file. A configuration has a few kilobytes; a megabyte is a file of another kind."""


def load(path: str | Path, overrides: Iterable[str] = ()) -> Config:
    """The configuration in a file, overridden by ``KEY=VALUE`` settings. ConfigError, also for a missing file."""
    try:
        with open_regular(Path(path)) as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
        if len(data) > LARGEST_FILE_BYTES:
            raise ConfigError(f"{path}: longer than {LARGEST_FILE_BYTES} bytes; accepted: a configuration in TOML")
        text = data.decode().removeprefix("\ufeff")  # a byte-order mark would be part of the first line
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}; accepted: a configuration, as `init` writes one") from None
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        kind = " (UTF-16, as some editors save)" if data.startswith((b"\xff\xfe", b"\xfe\xff")) else ""
        raise ConfigError(f"{path}: line {line} is not UTF-8{kind}; accepted: a configuration in TOML, UTF-8") from None
    return parse(text, str(path), overrides)


def load_signing_key(config: Config) -> bytes | None:
    """The 32 bytes of [signing] key_file; None without [signing]. ConfigError unless only its owner may read it."""
    if config.signing is None:
        return None
    path = config.resolve(config.signing.key_file)
    where = f"{config.file}: [signing] key_file = {path}"
    try:
        with open_regular(path) as file:
            mode = stat.S_IMODE(path.stat().st_mode)
            key = file.read(KEY_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{where}: {error.strerror}; accepted: a file of {KEY_BYTES} bytes, mode 0600") from None
    if mode & 0o077:
        raise ConfigError(f"{where}: mode {mode:04o}, readable by other users; accepted: mode 0600 (chmod 600)")
    if len(key) != KEY_BYTES:
        size = f"{len(key)} bytes" if len(key) < KEY_BYTES else f"more than {KEY_BYTES} bytes"
        raise ConfigError(f"{where}: {size}; accepted: {KEY_BYTES} bytes (head -c {KEY_BYTES} /dev/urandom)")
    return key
