"""SHELL: delivers the newest picture of a camera or stream: a thread reads all pictures, and keeps one.

Otherwise a detector that is slower than the camera would fall behind more and more: pictures queue in the driver and
in the network, and arrive seconds after their capture.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace

from fwav_companion.vision.images import Picture, Source, SourceEndedError, SourceLostError

READ_S = 1.0
"""Longest wait of one read of the source, if the source has a limit, seconds."""
HANGS_S = 5.0
"""Duration from which a read hangs, seconds. Drivers and FFmpeg have limits of their own, ten and five seconds."""


class NewestPicture:
    """A source that delivers the newest picture of another one, and counts those that it skips."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._changed = threading.Condition()
        self._picture: Picture | None = None
        self._skipped = 0
        self._failure: SourceLostError | SourceEndedError | MemoryError | None = None
        self._closed = False
        self._reads_since_s = time.monotonic()
        threading.Thread(target=self._read_all, name="camera", daemon=True).start()

    def read(self, timeout_s: float) -> Picture | None:
        """The newest picture that was not delivered yet, with the number of those skipped; None if none comes in time.

        Raises SourceLostError or SourceEndedError as the source does, after its last picture; MemoryError.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._picture is not None or self._failure is not None, timeout_s)
            picture, skipped = self._picture, self._skipped
            self._picture, self._skipped = None, 0
            if picture is not None:
                return replace(picture, skipped=picture.skipped + skipped)
            if self._failure is not None:
                raise self._failure
            return None

    @property
    def hangs(self) -> bool:
        """Whether a read has lasted longer than HANGS_S."""
        return time.monotonic() - self._reads_since_s > HANGS_S

    def close(self) -> None:
        """Stop reading. The thread closes the source: a driver must not be closed during a read."""
        self._closed = True

    def _read_all(self) -> None:
        try:
            while not self._closed:
                self._reads_since_s = time.monotonic()
                picture = self._source.read(READ_S)
                if picture is not None:
                    self._put(picture)
        except (SourceLostError, SourceEndedError, MemoryError) as error:  # without memory the process starts again
            self._fail(error)
        except Exception as error:  # noqa: BLE001  # of a driver's binding: a thread that ends silently would look like a hang
            self._fail(SourceLostError(f"{type(error).__name__}: {error}"))
        finally:
            self._source.close()

    def _put(self, picture: Picture) -> None:
        with self._changed:
            if self._picture is not None:
                self._skipped += 1 + self._picture.skipped
            self._picture = picture
            self._changed.notify()

    def _fail(self, error: SourceLostError | SourceEndedError | MemoryError) -> None:
        with self._changed:
            self._failure = error
            self._changed.notify()
