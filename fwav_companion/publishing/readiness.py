"""Readiness of the vehicle to localize targets: its conditions, the first obstacle, and when it is reported. Pure."""

from __future__ import annotations

from collections import deque
from math import isfinite

import msgspec

from fwav_companion.geometry.ellipses import NORMAL_95
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.types.messages import Notice, NoticeCode, Severity
from fwav_companion.types.reasons import Reason

SLOW = 0.8
"""Share of the wanted attitude rate below which interpolation may miss the flapping."""
RECOVERED = 0.85
"""Share of the wanted attitude rate above which a rate that was reported as slow counts as recovered."""
NO_PICTURES_S = 3.0
"""Age of the newest picture beyond which pictures count as missing."""

CHECK_NS = NS_PER_S
EARLIEST_NS = 3 * NS_PER_S
"""Time after the adoption before the vehicle is reported as ready: the rate meter needs one full window of 2 s."""
LATEST_NS = 5 * NS_PER_S
"""Time after the adoption until the first report, except of a slow attitude whose request has no outcome yet."""
METER_NS = 2 * NS_PER_S
"""Window of the rate meter: what it shows sooner after a rate's change is of both rates."""
HOLD_NS = 3 * NS_PER_S
"""Time for which a change must hold before it is reported."""
REPORT_NS = 10 * NS_PER_S
"""Shortest mean time between two reports: a third report waits until twice this time after the first."""

REFUSED_FIXES = {
    Reason.MALFORMED: "send JSON as the README shows",
    Reason.NO_TIME: "send exactly one of time_unix, time_monotonic, time_boot",
    Reason.WRONG_UNITS: "send times in seconds",
    Reason.FROM_THE_FUTURE: "correct the detector's clock or [camera] time_offset_s",
    Reason.TOO_LATE: "send detections sooner after the picture",
    Reason.WRONG_SIZE: "use the image size of [camera] calibration",
}
"""Advice for each reason for which a picture is refused."""
POSITIONS_STOPPED = "positions from the autopilot stopped: another program may have changed their rate"
ASK_CHECK = "run `fwav-companion check`"
NO_FIX = {
    Reason.NO_POSITION: (
        NoticeCode.NOT_READY_NO_POSITION,
        'no position from the autopilot: wait for its GPS, or set [vehicle] position = "none"',
    ),
    Reason.NO_HEIGHT: (
        NoticeCode.NOT_READY_NO_HEIGHT,
        "no height above the ground: check [ground] model and the autopilot's position messages",
    ),
    Reason.TERRAIN_UNFIT: (
        NoticeCode.NOT_READY_NO_HEIGHT,
        "the elevation model does not fit the take-off height: check [ground] terrain_datum",
    ),
    Reason.BEYOND_TERRAIN: (
        NoticeCode.NOT_READY_NO_HEIGHT,
        "no elevation data at this place: add its file to [ground] terrain",
    ),
    Reason.NO_TERRAIN: (
        NoticeCode.NOT_READY_NO_HEIGHT,
        "the elevation model has a void at this place: use a file without it",
    ),
    Reason.NO_GIMBAL: (
        NoticeCode.NOT_READY_NO_GIMBAL,
        "no attitude from the gimbal: check its link and [camera.mount] gimbal_device_id",
    ),
    Reason.STALE_GIMBAL: (
        NoticeCode.NOT_READY_NO_GIMBAL,
        "the gimbal's attitude is too old: check its link and message rate",
    ),
    Reason.GIMBAL_GAP: (
        NoticeCode.NOT_READY_NO_GIMBAL,
        "the gimbal moves too fast between its messages: have it report more often",
    ),
    Reason.GIMBAL_HORIZON: (
        NoticeCode.NOT_READY_NO_GIMBAL,
        "gimbal: angles from the horizon or from the body? Move, or set [camera.mount] levelled",
    ),
    Reason.GIMBAL_FLAGS: (
        NoticeCode.NOT_READY_NO_GIMBAL,
        "the gimbal's flags contradict each other: both yaw frames are set",
    ),
    Reason.GIMBAL_SETPOINT: (
        NoticeCode.NOT_READY_NO_GIMBAL,
        "the gimbal reports setpoints only: it must send GIMBAL_DEVICE_ATTITUDE_STATUS",
    ),
}
"""Reasons that prevent a fix at every pixel, with the code and text of the notice.

Other reasons (a ray above the horizon, a vehicle on the ground) depend on the view and do not prevent readiness.
"""


class Readiness(msgspec.Struct, frozen=True, kw_only=True):
    """Conditions of localization at one instant."""

    attitude_hz: float
    """Rate of the attitudes, Hz; 0 while no attitude arrives."""
    wanted_attitude_hz: float
    rate_trouble: str = ""
    """What the autopilot does with requests for message rates if it grants none; "" otherwise."""
    attitude_pending: bool = False
    """Whether our request for the attitude's rate has no outcome yet."""
    clock_sigma_s: float
    """One sigma of the autopilot's clock, seconds; infinite while it is unknown."""
    frames_hz: float
    frame_age_s: float
    """Age of the newest picture, seconds; infinite before the first."""
    refused: Reason | None = None
    """Reason why the newest picture was refused; None where it was used."""
    no_fix: Reason | None = None
    """Reason why a target straight below would have no fix; None where it would have one."""
    within95_m: float | None = None
    """Radius of the 95 % circle of a target straight below, relative to the vehicle, metres."""
    height_m: float | None = None
    """Height of the camera above the ground for that radius, metres."""
    had_position: bool = False
    """Whether the autopilot has sent a position before."""
    autopilot_silent: bool = False
    """Whether heartbeats are overdue: the loss of the autopilot may be reported next, and explains the rest."""


class Obstacle(msgspec.Struct, frozen=True):
    """The first obstacle to readiness, in the order of the data's path."""

    code: NoticeCode
    text: str
    """What is wrong, and what to do."""


def obstacle(readiness: Readiness, reported: NoticeCode | None = None) -> Obstacle | None:
    """The first obstacle; None where the vehicle is ready. ``reported``: code of the last report, for hysteresis."""
    if not readiness.attitude_hz:
        text = "no attitude from the autopilot: check the wire to its RX pin and [signing]"
        return Obstacle(NoticeCode.NOT_READY_NO_ATTITUDE, text)
    if not isfinite(readiness.clock_sigma_s):
        text = "the autopilot's clock is unknown: check that its messages carry time_boot_ms"
        return Obstacle(NoticeCode.NOT_READY_NO_CLOCK, text)
    if readiness.frame_age_s > NO_PICTURES_S:
        text = "no pictures: check [vision] source, or that the detector sends to [detections] url"
        return Obstacle(NoticeCode.NOT_READY_NO_PICTURES, text)
    if readiness.refused is not None:
        fix = REFUSED_FIXES.get(readiness.refused, ASK_CHECK)
        text = f"pictures are refused ({readiness.refused.value}): {fix}"
        return Obstacle(NoticeCode.NOT_READY_PICTURES_REFUSED, text)
    if readiness.no_fix is Reason.NO_POSITION and readiness.had_position:
        return Obstacle(NoticeCode.NOT_READY_NO_POSITION, POSITIONS_STOPPED)
    if readiness.no_fix in NO_FIX:
        return Obstacle(*NO_FIX[readiness.no_fix])
    enough = RECOVERED if reported is NoticeCode.NOT_READY_SLOW_ATTITUDE else SLOW
    if readiness.attitude_hz < enough * readiness.wanted_attitude_hz:
        rates = f"attitude at {readiness.attitude_hz:.0f} Hz, wanted {readiness.wanted_attitude_hz:.0f} Hz"
        if readiness.rate_trouble:
            text = f"{rates}; the autopilot {readiness.rate_trouble}: set its telemetry rate, or lower [rates] attitude"
            return Obstacle(NoticeCode.NOT_READY_SLOW_ATTITUDE, text)
        limits = "raise SCHED_LOOP_RATE (ArduPilot) or MAV_0_RATE (PX4)"
        text = f"{rates}: {limits}, stop other programs that set rates, or lower [rates] attitude"
        return Obstacle(NoticeCode.NOT_READY_SLOW_ATTITUDE, text)
    return None


def readiness_notice(readiness: Readiness, reported: NoticeCode | None = None) -> Notice:
    """Notice of the state: ready with its rates and 95 % accuracy, or the first obstacle and what to do."""
    found = obstacle(readiness, reported)
    if found is not None:
        return Notice(found.code, Severity.WARNING, f"not ready: {found.text}", to_ground=True)
    accuracy = f"clock {max(0.1, 1e3 * NORMAL_95 * readiness.clock_sigma_s):.1f} ms"
    if readiness.within95_m is not None and readiness.height_m is not None and isfinite(readiness.within95_m):
        from_height = f"(from {readiness.height_m:.0f} m, relative to the vehicle)"
        accuracy += f", target {readiness.within95_m:.1f} m {from_height}"
    rates = f"attitude {readiness.attitude_hz:.0f} Hz, camera {readiness.frames_hz:.0f}/s"
    return Notice(NoticeCode.READY, Severity.INFO, f"ready: {rates}, 95 % within: {accuracy}", to_ground=True)


class ReadinessReports:
    """Decides when readiness is reported: first 3 to 5 s after the adoption, then when a change has held for 3 s.

    A slow attitude is first reported 2 s after the outcome of our request for its rate, where the autopilot answers:
    the meter's window must not hold the rate from before.
    """

    def __init__(self) -> None:
        self.wake_at: HostNs | None = None
        """Instant of the next check; None while no autopilot is received."""
        self._began_ns = HostNs(0)
        self._reported: NoticeCode | None = None
        self._reports_ns: deque[HostNs] = deque(maxlen=2)
        self._changed: NoticeCode | None = None
        self._changed_ns = HostNs(0)
        self._pending_ns = HostNs(0)

    def begin(self, now: HostNs) -> None:
        """Forget earlier reports: the autopilot was adopted, came back, or rebooted."""
        self._began_ns, self._reported, self._changed = now, None, None
        self._reports_ns.clear()
        self.wake_at = HostNs(now + CHECK_NS)

    def stop(self) -> None:
        """Stop reporting: the autopilot is lost, which has a notice of its own."""
        self._reported, self.wake_at = None, None

    def on_wake(self, readiness: Readiness, now: HostNs) -> Notice | None:
        """Notice to send now; None where no change is to be reported."""
        self.wake_at = HostNs(now + CHECK_NS)
        if readiness.attitude_pending:
            self._pending_ns = now
        notice = readiness_notice(readiness, self._reported)
        due = self._is_due(notice.code, now)
        return self._report(notice, now) if due and not readiness.autopilot_silent else None

    def on_armed(self, readiness: Readiness, now: HostNs) -> Notice | None:
        """Notice of the present state at arming; None where the state is still undecided or was just reported."""
        notice = readiness_notice(readiness, self._reported)
        repeated = notice.code is self._reported and now < self._reports_ns[-1] + REPORT_NS
        return None if self._reported is None or repeated else self._report(notice, now)

    def _is_due(self, code: NoticeCode, now: HostNs) -> bool:
        if code is NoticeCode.NOT_READY_SLOW_ATTITUDE and now < self._pending_ns + METER_NS:
            return False
        if self._reported is None:
            return now >= self._began_ns + (EARLIEST_NS if code is NoticeCode.READY else LATEST_NS)
        if code is self._reported:
            self._changed = None
            return False
        if code is not self._changed:
            self._changed, self._changed_ns = code, now
        often = len(self._reports_ns) == 2 and now < self._reports_ns[0] + 2 * REPORT_NS
        return now >= self._changed_ns + HOLD_NS and not often

    def _report(self, notice: Notice, now: HostNs) -> Notice:
        self._reported, self._changed = notice.code, None
        self._reports_ns.append(now)
        return notice
