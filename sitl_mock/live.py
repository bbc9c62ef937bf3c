"""The mock in real time over a real link: one loop, no threads."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import NamedTuple

from sitl_mock import truth
from sitl_mock.options import Options
from sitl_mock.outputs import DetectionFile, Detections, TruthFile
from sitl_mock.simulate import Event, Simulation
from sitl_mock.transports import open_transport, wait

LONGEST_WAIT_S = 0.1
"""Longest wait, seconds: a stop signal is noticed within this time."""


class Plan(NamedTuple):
    """Destinations of all outputs; "" is an output that is not used."""

    connect: str
    detections: str = ""
    detections_file: str = ""
    truth: str = ""
    truth_csv: str = ""


def run(
    options: Options, plan: Plan, stopped: Callable[[], bool], say: Callable[[str], None], start_ns: int = 0
) -> None:
    """Runs the flight until its end or a stop. Raises ValueError or OSError for a link or output that cannot be opened.

    ``start_ns``: start of the flight on the monotonic clock, so that other processes can run the same flight; 0: now.
    """
    with ExitStack() as opened:
        transport = opened.enter_context(closing(open_transport(plan.connect)))
        unix_minus_host_s = time.time() - time.monotonic()
        simulation = Simulation(options, start_ns or time.monotonic_ns(), unix_minus_host_s)
        take = _outputs(plan, simulation, opened)
        say(f"sitl-mock ready: {transport.name} scenario {options.scenario} seed {options.seed}")
        while not stopped() and (wake_at := simulation.wake_at) is not None:
            timeout_s = (wake_at - time.monotonic_ns()) * 1e-9
            for data in wait(transport, min(LONGEST_WAIT_S, max(0.0, timeout_s))):
                simulation.on_bytes(data, time.monotonic_ns())
            for event in simulation.advance(min(time.monotonic_ns(), simulation.end_ns)):
                if isinstance(event[1], bytes):
                    transport.send(event[1])
                take(event)


def _outputs(plan: Plan, simulation: Simulation, opened: ExitStack) -> Callable[[Event], None]:
    """Opens the outputs of the plan; returns a function that passes an event to the outputs that use it."""
    sinks: list[Callable[[Event], None]] = []
    if plan.detections:
        socket = opened.enter_context(closing(Detections(plan.detections)))
        sinks.append(lambda event: socket.send(event[1]) if isinstance(event[1], dict) else None)
    if plan.detections_file:
        file = opened.enter_context(closing(DetectionFile(Path(plan.detections_file), simulation.unix_minus_host_s)))
        sinks.append(lambda event: file.write(event[1], event[0]) if isinstance(event[1], dict) else None)
    if plan.truth:
        sinks.append(opened.enter_context(closing(TruthFile(Path(plan.truth), simulation))).take)
    if plan.truth_csv:
        Path(plan.truth_csv).write_text(truth.csv_text(simulation, simulation.options.seconds), encoding="utf-8")

    def take(event: Event) -> None:
        for sink in sinks:
            sink(event)

    return take
