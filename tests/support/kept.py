"""Results that one test process makes and every worker of the same run reads: one file each, behind a lock."""

from __future__ import annotations

import fcntl
import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

FOLDER = "FWAV_TESTS_KEPT"
"""Environment variable with the folder of this run; ``tests/conftest.py`` makes the folder and removes it."""
Made = TypeVar("Made")


def kept(key: str, make: Callable[[], Made]) -> Made:
    """A separate copy, for every caller, of what the first caller in this run made under the key."""
    if FOLDER not in os.environ:
        return make()
    path = Path(os.environ[FOLDER]) / hashlib.sha256(key.encode()).hexdigest()
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            part = path.with_suffix(".part")
            part.write_bytes(pickle.dumps(make(), pickle.HIGHEST_PROTOCOL))
            part.rename(path)
    return pickle.loads(path.read_bytes())
