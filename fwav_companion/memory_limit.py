"""SHELL: a limit of memory for a process that reads files of strangers: a model or a picture may ask for all of it."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress

GIB = 1 << 30
LEAST = GIB
"""Least limit, bytes: onnxruntime, OpenCV and numpy reserve 265 MiB before they load a model, most of it untouched."""
VISION_SHARE, MOST_VISION = 0.5, 2 * GIB
"""Limit of the vision process: a share of the memory, and at most so many bytes, forty times what AprilTags at 640x480
take. `check` opens a model within the same limit."""
OPENCV_NO_MEMORY = -4
"""OpenCV's code of an error for want of memory, StsNoMem."""
WORDS = ("bad_alloc", "bad allocation", "allocate memory")
"""Of errors of onnxruntime for want of memory."""


def limit_of(share: float, most: int) -> int:
    """A share of the machine's memory, bytes, at most ``most``."""
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(LEAST, min(most, round(share * whole)))


def set_limit(limit: int) -> None:
    """Limit the private memory of this process to so many bytes, unless it is limited to less."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard == resource.RLIM_INFINITY or limit < hard:
        with suppress(OSError, ValueError):  # some kernels have no such limit
            resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


@contextmanager
def limited(limit: int) -> Iterator[None]:
    """A context with this limit."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    set_limit(limit)
    try:
        yield
    finally:
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_DATA, before)


def is_want_of_memory(error: BaseException) -> bool:
    """Whether an error is Python's, OpenCV's or onnxruntime's for want of memory."""
    if isinstance(error, MemoryError) or getattr(error, "code", None) == OPENCV_NO_MEMORY:
        return True
    return any(word in str(error) for word in WORDS)
