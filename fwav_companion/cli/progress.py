"""Progress of long work: a transient bar on stderr if it is a terminal, otherwise nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fwav_companion.recording.line_types import Line
    from fwav_companion.replay import Photographs, Recording

    Watched = Callable[[str, Iterator[Line]], Iterator[Line]]


@contextmanager
def steps(name: str, total: int) -> Iterator[Callable[[], None]]:
    """A context that yields a function to call after each step."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(name, total=total)
        yield lambda: progress.advance(task)


@contextmanager
def described_steps(name: str, total: int) -> Iterator[Callable[[str], None]]:
    """A context that yields a function to call after each step, with what is known by then."""
    if not sys.stderr.isatty():
        yield lambda _known: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(name, total=total)
        yield lambda known: progress.update(task, advance=1, description=f"{name}: {known}")


@contextmanager
def replays(recording: Recording | Photographs) -> Iterator[Watched]:
    """A context that yields a function of a replay's name and lines: it yields the lines and shows a bar by time."""
    from fwav_companion.replay import Photographs

    if not sys.stderr.isatty() or isinstance(recording, Photographs) or not recording.messages:
        yield lambda _name, lines: lines
        return
    from rich.console import Console
    from rich.progress import Progress

    from fwav_companion.recording.line_types import line_unix_s

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
