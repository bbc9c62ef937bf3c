"""The demonstration on a terminal: a table that lives, a progress bar, a summary."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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

from fwav_companion.tools.demo.flight import Moment, Outcome
from fwav_companion.tools.demo.scoreboard import Score

STATE_STYLES = {"tentative": "yellow", "confirmed": "green", "coasting": "cyan", "dropped": "dim"}
TEXTS_SHOWN = 3
AFTERGLOW_S = 0.3
INTRODUCTION = (
    "A mock flapping-wing vehicle flies a figure eight over AprilTags. Its camera shakes with every wing beat; its "
    "clock, compass, mount and position are off by amounts that nobody is told. The service finds the tags in the "
    "rendered pictures, tells a ground station where they are, and how sure it is."
)


class UnpipedConsole(Console):
    """Leaves it to the command line what becomes of a pipe that nobody reads; rich's own ends with status 1."""

    def on_broken_pipe(self) -> None:
        """As any other output that nobody reads."""
        raise BrokenPipeError


class LiveTable:
    """``watch`` shows a moment; outside of a terminal nothing is shown until the end."""

    def __init__(self, console: Console, seconds: float) -> None:
        self._console = console
        self._seconds = seconds
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(None), TextColumn("{task.fields[told]}"))
        self._task = self._bar.add_task("starting", total=seconds, told="")
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

    def watch(self, moment: Moment) -> None:
        """Show this; after the flight the last of it stands until the summary."""
        if not self._console.is_terminal or moment.flown_s > self._seconds + AFTERGLOW_S:
            return
        told = f"{min(max(moment.flown_s, 0.0), self._seconds):4.0f} of {self._seconds:.0f} s"
        doing = "starting" if moment.flown_s < 0.0 else "flying"
        self._bar.update(self._task, completed=max(0.0, moment.flown_s), description=doing, told=told)
        self._live.update(Group(self._bar, targets_table(moment.scores), _health(moment)))


@contextmanager
def working(console: Console) -> Iterator[Callable[[str], None]]:
    """While the report is made: on a terminal what is being done, nothing in a pipe."""
    if not console.is_terminal:
        yield lambda _told: None
        return
    with console.status("the report") as status:
        yield lambda told: status.update(f"the report: {told}")


def targets_table(scores: list[Score]) -> Table:
    """A row a target."""
    table = Table(expand=True)
    table.add_column("target")
    table.add_column("state")
    for heading in ("north m", "east m", "claimed 95 % m", "error m", "pictures"):
        table.add_column(heading, justify="right")
    for score in scores:
        table.add_row(
            f"tag {score.id}",
            Text(score.state or "not seen", STATE_STYLES.get(score.state, "dim")),
            *((f"{score.north:.2f}", f"{score.east:.2f}") if score.state else ("", "")),
            _metres(score.claimed95_m),
            Text(_metres(score.error_m), _error_style(score)),
            str(score.usable_frames),
        )
    return table


def show_outcome(console: Console, outcome: Outcome, report: tuple[Path, str] | None) -> None:
    """The summary."""
    console.print(targets_table(outcome.scores))
    found = [score for score in outcome.scores if score.found and score.error_m is not None]
    inside = sum(
        score.error_m <= score.claimed95_m for score in found if score.error_m is not None and score.claimed95_m
    )
    if found:
        unseen = sum(not score.found and not score.due for score in outcome.scores)
        beside = f" ({unseen} never readable for long enough)" if unseen else ""
        tags = f"{len(found)} of {len(outcome.scores)} tags found{beside}"
        console.print(f"{tags}; {inside} of {len(found)} inside their claimed 95 % radius.", soft_wrap=True)
    sent = outcome.heard.get("CAMERA_TRACKING_GEO_STATUS", 0)
    told = f"The ground station received {sent} target positions (CAMERA_TRACKING_GEO_STATUS) over MAVLink."
    console.print(told, soft_wrap=True)
    if report is not None:
        console.print(report[1], soft_wrap=True)
    if outcome.recording is not None:
        console.print(f"recording  {outcome.recording}", soft_wrap=True)
    if report is not None:
        console.print(f"report     {report[0]}", soft_wrap=True)
    for trouble in outcome.troubles:
        Console(stderr=True).print(Text(f"demo: {trouble}", "bold red"), soft_wrap=True)


def _health(moment: Moment) -> RenderableType:
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim")
    grid.add_column()
    for name, text in (
        ("vehicle", _vehicle(moment.status)),
        ("links", _links(moment.status)),
        ("clock", _clock(moment.clock)),
        ("camera", _camera(moment)),
        ("to ground", _to_ground(moment)),
    ):
        grid.add_row(name, text)
    for text in moment.texts[-TEXTS_SHOWN:]:
        grid.add_row("said", text)
    return Panel(grid, title="health", title_align="left", border_style="dim")


def _vehicle(status: Mapping[str, Any]) -> str:
    autopilot = status.get("autopilot")
    if not autopilot:
        return "no autopilot heard yet"
    rates = (status.get("telemetry") or {}).get("rates_hz") or {}
    wanted = ("ATTITUDE_QUATERNION", "ATTITUDE", "GLOBAL_POSITION_INT")
    told = ", ".join(f"{name} {rates[name]:.0f} Hz" for name in wanted if rates.get(name))
    return f"{autopilot['kind']}, {'armed' if autopilot['armed'] else 'not armed'}; {told}"


def _links(status: Mapping[str, Any]) -> str:
    told = []
    for link in status.get("traffic") or []:
        received = sum(peer["received"] for peer in link["peers"])
        lost = sum(peer["lost"] for peer in link["peers"])
        told.append(f"{link['name']} {'up' if link['up'] else 'down'}, {lost} of {received + lost} messages lost")
    return "; ".join(told)


def _clock(clock: Mapping[str, Any] | None) -> str:
    if clock is None:
        return "not placed yet"
    return f"{clock['status']}: autopilot's to ours within {clock['sigma_s'] * 1e3:.2f} ms (one sigma)"


def _camera(moment: Moment) -> str:
    status = moment.status
    left_out = f", {moment.pictures_left_out} left out by a busy machine" if moment.pictures_left_out else ""
    counts = (
        f"{status.get('frames', 0)} frames, {status.get('detections', 0)} tags seen, {status.get('fixes', 0)} fixes"
    )
    return f"{moment.pictures} pictures rendered{left_out}; {counts}"


def _to_ground(moment: Moment) -> str:
    shown = ("HEARTBEAT", "CAMERA_TRACKING_GEO_STATUS", "CAMERA_TRACKING_IMAGE_STATUS")
    rates = ", ".join(f"{name} {moment.rates_hz[name]:.0f} Hz" for name in shown if name in moment.rates_hz)
    place = moment.place
    where = f"; selected at {place['lat']:.7f}, {place['lon']:.7f} ± {place['h_acc']:.2f} m" if place else ""
    return (rates or "nothing yet") + where


def _metres(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _error_style(score: Score) -> str:
    if score.error_m is None or score.claimed95_m is None or score.claimed999_m is None:
        return ""
    if score.error_m <= score.claimed95_m:
        return "green"
    return "yellow" if score.error_m <= score.claimed999_m else "red"
