"""SHELL: the state that a worker keeps between flights (the plan and the mock's process), and its work, one flight."""

from __future__ import annotations

import msgspec

from fwav_companion.tools.study.mock_process import MockError, MockProcess
from fwav_companion.tools.study.study_flight import fly_one
from fwav_companion.tools.study.study_plan import StudyPlan


class FlightWorker:
    """One plan, and a mock that is started with the first flight and again where it died."""

    def __init__(self, plan: StudyPlan) -> None:
        self.plan = plan
        self._mock: MockProcess | None = None

    def fly(self, index: int, arm: str) -> bytes:
        """The record of a flight, encoded. MockError where the mock cannot fly it."""
        try:
            return self._flown(index, arm)
        except MockError:
            self.close()
            return self._flown(index, arm)

    def close(self) -> None:
        """End the mock."""
        if self._mock is not None:
            self._mock.close()
            self._mock = None

    def _flown(self, index: int, arm: str) -> bytes:
        if self._mock is None:
            self._mock = MockProcess()
        return msgspec.json.encode(fly_one(self.plan, index, arm, self._mock.fly))


def fly_on_worker(worker: FlightWorker, index: int, arm: str) -> bytes:
    """One flight of a study as a piece of work."""
    return worker.fly(index, arm)
