"""Reports of every shift of an elevation model: a notice, a line, and the summary. Pure."""

from __future__ import annotations

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.localization import TerrainShift
from fwav_companion.pipeline.camera_pipeline import CameraPipeline
from fwav_companion.pipeline.output_buffer import OutputBuffer
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.recording.line_types import TerrainLine
from fwav_companion.recording.lines import unix_seconds
from fwav_companion.recording.summary_types import ShiftObject
from fwav_companion.types import Notice, NoticeCode, Severity


class TerrainReports:
    """Reports changes of the elevation model's shift, each once."""

    def __init__(self, target_log: TargetLog, outputs: OutputBuffer, unix_offset_ns: int) -> None:
        """``unix_offset_ns``: recording's clock minus host clock."""
        self._target_log = target_log
        self._outputs = outputs
        self._unix_offset_ns = unix_offset_ns
        self._reported: tuple[TerrainShift | None, str] = (None, "")

    def report(self, camera: CameraPipeline, text: str, now: HostNs) -> None:
        """Write the present shift as a line and ``text`` as a notice if either changed; "" gives no notice."""
        shift = camera.terrain_shift
        before, self._reported = self._reported, (shift, text)
        if before == self._reported:
            return
        if shift is not None:
            at_s = unix_seconds(now, self._unix_offset_ns)
            last = ShiftObject(shift_m=shift.shift_m, sigma_m=shift.sigma_m, source=shift.source.value)
            self._target_log.terrain = last
            line = TerrainLine(time_unix=at_s, shift_m=last.shift_m, sigma_m=last.sigma_m, source=last.source)
            self._target_log.write(line)
        if text:
            self._outputs.notify((Notice(NoticeCode.TERRAIN_PLACED, Severity.INFO, text, to_ground=True),), now)
