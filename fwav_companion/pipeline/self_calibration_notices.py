"""Reports of self-calibration: recorded lines each second, notices once, and lines for the configuration. Pure."""

from __future__ import annotations

from math import degrees

from fwav_companion.geometry.mounts import corrected_mount, euler_from_body_from_camera
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.recording.line_types import CalibrationLine
from fwav_companion.recording.lines import calibration_line
from fwav_companion.self_calibration import CalibrationReport, CalibrationStatus, PriorInflation, SharedParameter
from fwav_companion.types import Notice, NoticeCode, Severity
from fwav_companion.types.flight_status import SelfCalibrationReport

REPLACED = "self-calibration: the camera has moved since an earlier flight; that calibration is dropped"

DENIED_S = 3
"""Seconds for which the smoother must contradict a prior before it is reported: its first solves see few sightings."""


class SelfCalibrationNotices:
    """Reports about one camera with its configured mount and delay."""

    def __init__(self, body_from_camera: Matrix3, time_offset_s: float) -> None:
        self._body_from_camera = body_from_camera
        self._time_offset_s = time_offset_s
        self._reported_mistake = ""
        self._reported_denied: set[int] = set()
        self._reported_replaced = False
        self._denied_s = 0
        """Number of reports in a row, one a second, that contradict a prior."""
        self._reported_status = CalibrationStatus.WAITING

    def line(self, report: CalibrationReport, time_unix: float) -> CalibrationLine:
        """Line for the recording. Its time offset is the total, the configured one included."""
        return calibration_line(
            time_unix,
            self._time_offset_s + report.time_offset_s,
            time_offset_sigma_s=report.time_offset_sigma_s,
            mount=report.mount,
            mount_sigma=report.mount_sigma,
            status=report.status.value,
            reason=report.reason,
            mistake=report.mistake,
            parameters=report.parameters,
        )

    def notices(self, report: CalibrationReport) -> tuple[Notice, ...]:
        """Notices of a gross mistake, of results and of exceeded priors, each once."""
        made: tuple[Notice, ...] = ()
        if report.mistake and report.mistake != self._reported_mistake:
            self._reported_mistake = report.mistake
            made = (
                Notice(NoticeCode.MOUNT_MISTAKE, Severity.ERROR, f"camera mount: {report.mistake}", to_ground=True),
            )
        if report.status is not self._reported_status and report.status is not CalibrationStatus.WAITING:
            self._reported_status = report.status
            text = f"self-calibration: {self._what_came_out(report)}"
            made = (*made, Notice(NoticeCode.CALIBRATION_RESULT, Severity.INFO, text))
        if report.replaced and not self._reported_replaced:
            self._reported_replaced = True
            made = (*made, Notice(NoticeCode.CALIBRATION_DROPPED, Severity.WARNING, REPLACED, to_ground=True))
        self._denied_s = self._denied_s + 1 if report.denied else 0
        if report.status is CalibrationStatus.CALIBRATED or (report.parameters and self._denied_s >= DENIED_S):
            made = (*made, *self._denials(report))
        return made

    def _denials(self, report: CalibrationReport) -> list[Notice]:
        news = [each for each in report.denied if each.parameter not in self._reported_denied]
        self._reported_denied.update(each.parameter for each in news)
        texts = [f"self-calibration: {_denial(each)}" for each in news]
        return [Notice(NoticeCode.PRIOR_EXCEEDED, Severity.WARNING, text, to_ground=True) for text in texts]

    def _what_came_out(self, report: CalibrationReport) -> str:
        if report.status is CalibrationStatus.AMBIGUOUS:
            delays = " or ".join(f"{delay:.3f} s" for delay in self._alternatives(report))
            return (
                f"[camera] time_offset_s may be {delays}, because the wing beat repeats: "
                "fly turns, or set a smaller [uncertainty] time_offset_sigma_s"
            )
        if report.status is CalibrationStatus.UNEXPLAINED:
            return "no delay within [uncertainty] time_offset_sigma_s fits the flight: nothing is corrected"
        return "; ".join(self.configuration_lines(report))

    def _alternatives(self, report: CalibrationReport) -> list[float]:
        return sorted(self._time_offset_s + delay for delay in report.alternatives)

    def configuration_lines(self, report: CalibrationReport) -> list[str]:
        """Lines to paste into the configuration for the next flight; only for parameters that were found."""
        if report.status not in (CalibrationStatus.TIME, CalibrationStatus.CALIBRATED):
            return []
        lines = [f"[camera] time_offset_s = {self._time_offset_s + report.time_offset_s:.4f}"]
        if report.status is CalibrationStatus.CALIBRATED:
            mount = corrected_mount(self._body_from_camera, report.mount)
            roll, pitch, yaw = (degrees(angle) for angle in euler_from_body_from_camera(mount))
            lines.append(f"[camera.mount] roll_deg = {roll:.3f}, pitch_deg = {pitch:.3f}, yaw_deg = {yaw:.3f}")
        return lines

    def status(self, report: CalibrationReport) -> SelfCalibrationReport:
        """Self-calibration's part of the status."""
        return SelfCalibrationReport(
            status=report.status.value,
            reason=report.reason,
            time_offset_s=self._time_offset_s + report.time_offset_s,
            time_offset_sigma_s=report.time_offset_sigma_s,
            mount_deg=[degrees(angle) for angle in report.mount],
            mount_sigma_deg=[degrees(sigma) for sigma in report.mount_sigma],
            time_offset_rivals_s=self._alternatives(report),
            mistake=report.mistake,
            replaced=report.replaced,
            configuration_lines=self.configuration_lines(report),
            parameters=list(report.parameters),
        )


def _denial(each: PriorInflation) -> str:
    if each.parameter == SharedParameter.DELAY:
        return f"camera stamps are {1e3 * each.alone:+.0f} ms off, beyond [uncertainty] time_offset_sigma_s"
    if each.parameter == SharedParameter.HEIGHT:
        return (
            f"height above ground is {each.alone:+.1f} m off, beyond [uncertainty] height_bias_m: check [ground] model"
        )
    axis = "xyz"[each.parameter - SharedParameter.MOUNT_X]
    return f"mount is {degrees(each.alone):+.1f} degrees off about body {axis}, beyond [uncertainty] mount_bias_deg"
