"""Long work on a terminal: a bar on stderr that goes away; nothing in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fwav_companion.recording.lines import Line
    from fwav_companion.replay import Recording

    Watched = Callable[[str, Iterator[Line]], Iterator[Line]]


@contextmanager
def steps(told: str, total: int) -> Iterator[Callable[[], None]]:
    """Call what it yields after every step."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(told, total=total)
        yield lambda: progress.advance(task)


@contextmanager
def replays(recording: Recording) -> Iterator[Watched]:
    """Hand what it yields a replay's name and its lines: the same lines come back, and a bar follows their time."""
    if not sys.stderr.isatty() or not recording.messages:
        yield lambda _name, lines: lines
        return
    from rich.console import Console
    from rich.progress import Progress

    from fwav_companion.recording.lines import line_unix_s

    begun, ended = recording.messages[0][0] * 1e-6, recording.messages[-1][0] * 1e-6
    with Progress(console=Console(stderr=True), transient=True) as progress:

        def watched(name: str, lines: Iterator[Line]) -> Iterator[Line]:
            task = progress.add_task(name, total=ended - begun)
            for line in lines:
                at_s = line_unix_s(line, recording.unix_offset_ns / 1e9)
                if at_s is not None:
                    progress.update(task, completed=at_s - begun)
                yield line
            progress.update(task, completed=ended - begun)

        yield watched
