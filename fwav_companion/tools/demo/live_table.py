"""The demonstration on a terminal: a live table of targets, the health of the service, and a summary at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table
from rich.text import Text

from fwav_companion.geometry.ellipses import ELLIPSE_95, NORMAL_95
from fwav_companion.recording.line_types import ClockEstimateLine
from fwav_companion.tools.demo.flight import DemoResult, FlightProgress
from fwav_companion.tools.demo.scoreboard import TargetScore

STATE_STYLES = {"tentative": "yellow", "confirmed": "green", "coasting": "cyan", "dropped": "dim"}
TEXTS_SHOWN = 3
SHOWN_AFTER_S = 0.3
"""Time after the end of the flight in which the table is still updated, seconds."""
INTRODUCTION = (
    "A mock flapping-wing vehicle flies a figure eight over AprilTags. Its camera shakes with every wing beat. Its "
    "clock, compass, mount and position have errors that the service does not know. The service finds the tags in "
    "rendered pictures and sends their positions and accuracy to a ground station."
)


class UnpipedConsole(Console):
    """A console that leaves a broken pipe to the command line; rich's own ends with status 1."""

    def on_broken_pipe(self) -> None:
        """Raise BrokenPipeError, as any other output to a closed pipe does."""
        raise BrokenPipeError


class LiveTable:
    """A table that :meth:`watch` updates on a terminal; in a pipe nothing is shown before the summary."""

    def __init__(self, console: Console, seconds: float) -> None:
        self._console = console
        self._seconds = seconds
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(None), TextColumn("{task.fields[time]}"))
        self._task = self._bar.add_task("starting", total=seconds, time="")
        self._live = Live(console=console, refresh_per_second=5, transient=True)

    def __enter__(self) -> Self:
        self._console.print(INTRODUCTION)
        if self._console.is_terminal:
            self._live.start()
            self._live.update(Group(self._bar))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def watch(self, progress: FlightProgress) -> None:
        """Show this state; after the flight the last state stays until the summary."""
        if not self._console.is_terminal or progress.flown_s > self._seconds + SHOWN_AFTER_S:
            return
        time = f"{min(max(progress.flown_s, 0.0), self._seconds):4.0f} of {self._seconds:.0f} s"
        doing = "starting" if progress.flown_s < 0.0 else "flying"
        self._bar.update(self._task, completed=max(0.0, progress.flown_s), description=doing, time=time)
        self._live.update(Group(self._bar, targets_table(progress.scores), _health(progress)))


@contextmanager
def report_progress(console: Console) -> Iterator[Callable[[str], None]]:
    """A function that shows the current step of the report on a terminal, and does nothing in a pipe."""
    if not console.is_terminal:
        yield lambda _step: None
        return
    with console.status("the report") as status:
        yield lambda step: status.update(f"the report: {step}")


def targets_table(scores: list[TargetScore]) -> Table:
    """The table with a row for each target."""
    table = Table(expand=True)
    table.add_column("target")
    table.add_column("state")
    for heading in ("north m", "east m", "claimed 95 % m", "error m", "pictures"):
        table.add_column(heading, justify="right")
    for score in scores:
        table.add_row(
            score.name,
            Text(score.state or "not seen", STATE_STYLES.get(score.state, "dim")),
            *((f"{score.north:.2f}", f"{score.east:.2f}") if score.state else ("", "")),
            _metres(score.claimed95_m),
            Text(_metres(score.error_m), _error_style(score)),
            str(score.usable_frames),
        )
    return table


def show_result(console: Console, result: DemoResult, report: tuple[Path, Sequence[str]] | None) -> None:
    """Print the summary; ``report``: its path, and its results as sentences."""
    console.print(targets_table(result.scores))
    found = [score for score in result.scores if score.found and score.error_m is not None]
    inside = sum(
        score.error_m <= score.claimed95_m for score in found if score.error_m is not None and score.claimed95_m
    )
    if found:
        unseen = sum(not score.found and not score.due for score in result.scores)
        note = f" ({unseen} not readable for long enough)" if unseen else ""
        ghosts = sum(score.ghosts for score in result.scores)
        tags = f"{len(found)} of {len(result.scores)} tags found{note}{f', {ghosts} ghosts' if ghosts else ''}"
        console.print(f"{tags}; {inside} of {len(found)} inside their claimed 95 % radius.", soft_wrap=True)
    sent = result.heard.get("CAMERA_TRACKING_GEO_STATUS", 0)
    received = f"The ground station received {sent} target positions (CAMERA_TRACKING_GEO_STATUS) over MAVLink."
    console.print(received, soft_wrap=True)
    for sentence in () if report is None else report[1]:
        console.print(sentence, soft_wrap=True)
    if result.recording is not None:
        console.print(f"recording  {result.recording}", soft_wrap=True)
    if report is not None:
        console.print(f"report     {report[0]}", soft_wrap=True)
    for trouble in result.troubles:
        Console(stderr=True).print(Text(f"demo: {trouble}", "bold red"), soft_wrap=True)


def _health(progress: FlightProgress) -> RenderableType:
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim")
    grid.add_column()
    for name, text in (
        ("vehicle", _vehicle(progress.status)),
        ("links", _links(progress.status)),
        ("clock", _clock(progress.clock)),
        ("camera", _camera(progress)),
        ("to ground", _to_ground(progress)),
    ):
        grid.add_row(name, text)
    for text in progress.texts[-TEXTS_SHOWN:]:
        grid.add_row("text", text)
    return Panel(grid, title="health", title_align="left", border_style="dim")


def _vehicle(status: Mapping[str, Any]) -> str:
    autopilot = status.get("autopilot")
    if not autopilot:
        return "no autopilot heard yet"
    rates = (status.get("telemetry") or {}).get("rates_hz") or {}
    shown = ("ATTITUDE_QUATERNION", "ATTITUDE", "GLOBAL_POSITION_INT")
    heard = ", ".join(f"{name} {rates[name]:.0f} Hz" for name in shown if rates.get(name))
    return f"{autopilot['kind']}, {'armed' if autopilot['armed'] else 'not armed'}; {heard}"


def _links(status: Mapping[str, Any]) -> str:
    found = []
    for link in status.get("traffic") or []:
        received = sum(peer["received"] for peer in link["peers"])
        lost = sum(peer["lost"] for peer in link["peers"])
        found.append(f"{link['name']} {'up' if link['up'] else 'down'}, {lost} of {received + lost} messages lost")
    return "; ".join(found)


def _clock(clock: ClockEstimateLine | None) -> str:
    if clock is None:
        return "offset to the autopilot's clock not known yet"
    error95_ms = 1e3 * min(NORMAL_95 * clock.sigma_s, clock.bound_s)
    return f"{clock.status}: offset to the autopilot's clock known to {error95_ms:.2f} ms (95 %)"


def _camera(progress: FlightProgress) -> str:
    status, skipped = progress.status, progress.pictures_left_out
    left_out = f", {skipped} skipped by a busy machine" if skipped else ""
    counts = (
        f"{status.get('frames', 0)} frames, {status.get('detections', 0)} tags seen, {status.get('fixes', 0)} fixes"
    )
    return f"{progress.pictures} pictures rendered{left_out}; {counts}"


def _to_ground(progress: FlightProgress) -> str:
    shown = ("HEARTBEAT", "CAMERA_TRACKING_GEO_STATUS", "CAMERA_TRACKING_IMAGE_STATUS")
    rates = ", ".join(f"{name} {progress.rates_hz[name]:.0f} Hz" for name in shown if name in progress.rates_hz)
    place = progress.place
    if place is None:
        return rates or "nothing yet"
    # h_acc is one sigma along the larger semi-axis: a circle of 2.45 times that holds 95 % or more.
    radius_m = ELLIPSE_95 * place["h_acc"]
    return (
        f"{rates or 'nothing yet'}; selected at {place['lat']:.7f}, {place['lon']:.7f}, within {radius_m:.2f} m (95 %)"
    )


def _metres(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _error_style(score: TargetScore) -> str:
    if score.error_m is None or score.claimed95_m is None or score.claimed999_m is None:
        return ""
    if score.error_m <= score.claimed95_m:
        return "green"
    return "yellow" if score.error_m <= score.claimed999_m else "red"
