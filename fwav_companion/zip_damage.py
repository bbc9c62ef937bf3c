"""What reading a zip file of a stranger can raise: each method of compression has errors of its own."""

from __future__ import annotations

import zlib
from lzma import LZMAError
from typing import Final
from zipfile import BadZipFile

ZIP_DAMAGE: Final = (BadZipFile, zlib.error, LZMAError, NotImplementedError, RuntimeError, EOFError)
"""OSError apart, which names a path, or the damage of bzip2."""
