"""Small studies: a plan by the template's configuration, flown in this process."""

from __future__ import annotations

import json
from importlib.resources import files

import msgspec

from fwav_companion.camera import parse_calibration
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.mock_process import FlownFlight
from fwav_companion.tools.study.record_file import Environment
from fwav_companion.tools.study.study_plan import StudyPlan, radial_lens
from sitl_mock.arguments import with_settings
from sitl_mock.scenarios import scenario
from sitl_mock.service import flown_files

TEMPLATES = files("fwav_companion.cli.templates")
CONFIG = (TEMPLATES / "fwav-companion.toml").read_text()
CAMERA = (TEMPLATES / "camera.yaml").read_text()


def make_plan(**differences) -> StudyPlan:
    """A short orbit, in which the target is always in view."""
    lens = radial_lens(parse_calibration(CAMERA, "camera.yaml").lens)
    chosen = {"config": CONFIG, "flights": 3, "seconds": 8.0, "pattern": "orbit", "seed": 1} | differences
    return StudyPlan(config_name="fwav-companion.toml", lens=lens, **chosen)


def fly(request: dict) -> FlownFlight:
    """The mock in this process."""
    request = json.loads(json.dumps(request))
    header, (telemetry, detections, truth) = flown_files(
        with_settings(scenario("default"), request["set"]), request["rates_hz"]
    )
    return FlownFlight(
        telemetry=telemetry,
        detections=detections,
        truth=truth.decode(),
        frames=header["frames"],
        in_view=header["in_view"],
        biases=header["biases"],
    )


class InlineWorkers:
    """Workers of this process: each task at once, in order."""

    count = 1
    environment = Environment(("a processor",), {"numpy": "2"})

    def __init__(self, work=None) -> None:
        self.work = work
        self.tasks = []

    def cpu_s(self):
        return 0.0

    def run(self, job, tasks, make, arguments):
        state = make(*arguments)
        for task in tasks:
            self.tasks.append(task)
            yield job(state, *task) if self.work is None else self.work(state, *task)
        if hasattr(state, "close"):
            state.close()


class CountedProgress:
    """A study's progress without a screen: its flights counted, and the time that it announced."""

    def __init__(self):
        self.total_flights = self.count = 0
        self.seconds = None

    def total(self, flights):
        self.total_flights = flights

    def flown(self):
        self.count += 1

    def expected(self, seconds):
        self.seconds = seconds


def invented_record(_worker, index, arm):
    """A record without a flight, as a worker returns it."""
    limits = {"position": 1.0, "mount": 0.5, "heading": 0.1}
    varied = {"varied": {}, "flown": {}, "drawn": {}}
    record = FlightRecord(
        index=index, arm=arm, state="found", no_answer="", error_m=1.0 + index % 7, limits_m=limits, **varied
    )
    return msgspec.json.encode(record)
