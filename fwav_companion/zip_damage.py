"""What reading a zip file of a stranger can raise: each method of compression has errors of its own."""

from __future__ import annotations

import zlib
from lzma import LZMAError
from typing import Final
from zipfile import BadZipFile

ZIP_DAMAGE: Final = (
    BadZipFile, zlib.error, LZMAError, UnicodeDecodeError, NotImplementedError, RuntimeError, EOFError,
)  # fmt: skip
"""All but OSError, which bzip2 raises for damage and the file system for a path. UnicodeDecodeError: a name in the zip
file that claims to be UTF-8."""
