"""Lines and notices once a second: the clock, self-calibration, landmarks, an unknown readout. Pure."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.crowd_notices import CrowdNotices
from fwav_companion.pipeline.output_buffer import OutputBuffer
from fwav_companion.pipeline.solve_notices import SolveNotices
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.pipeline.terrain_reports import TerrainReports
from fwav_companion.recording.lines import unix_seconds


class SecondLines:
    """Writes lines and notices at each whole second of the recording's clock, in a replay at the same instants."""

    def __init__(
        self, components: Components, target_log: TargetLog, outputs: OutputBuffer, unix_offset_ns: int
    ) -> None:
        """``unix_offset_ns``: recording's clock minus host clock."""
        self._components = components
        self._target_log = target_log
        self._outputs = outputs
        self._unix_offset_ns = unix_offset_ns
        self._terrain = TerrainReports(target_log, outputs, unix_offset_ns)
        self._crowds = CrowdNotices()
        self._solves = SolveNotices()

    def next_after(self, now: HostNs) -> HostNs:
        """Host instant of the next whole second of the recording's clock."""
        return HostNs(now + NS_PER_S - (now + self._unix_offset_ns) % NS_PER_S)

    def write(self, at: HostNs) -> None:
        """Write the lines of this second."""
        clock_line = self._components.clock_line(at, self._unix_offset_ns)
        if clock_line is not None:
            self._target_log.write(clock_line)
        camera = self._components.camera
        if camera is None:
            return
        self._outputs.notify(camera.readout.notices(), at)
        if camera.crowd.labels:
            self._outputs.notify(self._crowds.notices(camera.crowd), at)
        solves = camera.tracker.solves
        if solves is not None:
            self._outputs.notify(self._solves.notices(solves), at)
        self._outputs.notify(camera.landmark_news.notices(camera.landmarks), at)
        self._outputs.notify(camera.pad_news.notices(), at)
        text = camera.shift_by_landmark()
        if text:
            self._terrain.report(camera, text, at)
        report = camera.calibration
        if report is not None:
            self._target_log.write(camera.calibration_news.line(report, unix_seconds(at, self._unix_offset_ns)))
            self._outputs.notify(camera.calibration_news.notices(report), at)
