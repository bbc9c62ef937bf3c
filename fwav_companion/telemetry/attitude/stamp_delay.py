"""Errors of attitude stamps: the delay of the loop that packs the message, and truncation to milliseconds."""

from __future__ import annotations

from math import sqrt

HALF_MS_NS = 500_000
"""Mean truncation error: a stamp truncated to whole milliseconds is 0.5 ms early on average."""
CUT_S = 1e-3

COPTER_DELAY_S = 0.0025
"""One loop of an ArduCopter at 400 Hz; PX4's loop is not longer."""
PLANE_DELAY_S = 0.02
"""One loop of an ArduPlane at 50 Hz."""

AUTOPILOT_ARDUPILOT = 3
PLANE_TYPES = frozenset({1, 19, 20, 21, 22, 23, 24, 25})
"""Vehicle types that ArduPlane reports: MAV_TYPE_FIXED_WING and the VTOLs. No firmware reports FLAPPING_WING."""
SLOWEST_LOOP_HZ, FASTEST_LOOP_HZ = 50.0, 2000.0
"""Limits that ArduPilot sets to SCHED_LOOP_RATE (AP_Scheduler::init)."""

IN_STEP_S, OUT_OF_STEP_S = 1.2e-4, 2.0e-4
"""Bounds of the stamps' scatter, seconds RMS: below the first, stamps count as synchronous with sampling; above the
second, no longer. Truncation to milliseconds alone scatters stamps by 0.29 ms RMS."""

SAMPLES_SHARE = 0.8
"""Stamp error of an interpolated attitude over that of one sample: interpolation averages samples whose stamps err
independently, which gives sqrt(sum of squared weights)."""


class AttitudeStamps:
    """Model of attitude stamps: an attitude is older than its stamp by up to ``delay_s``, uniformly. The mean is
    corrected, the rest is uncertainty.

    Where the attitudes show that stamps do not scatter, stamps are synchronous with sampling. Attitudes cannot show the
    constant delay that remains, so no delay is corrected. This is exact for a simulator that samples on whole
    milliseconds, and the best that can be known for a scheduler that never varies. A configured delay other than 0 is
    always applied.
    """

    __slots__ = ("_automatic", "_loop_hz", "_plane", "correction_ns", "delay_s", "in_step")

    def __init__(self, attitude_stamp_delay_s: float | str) -> None:
        self._automatic = isinstance(attitude_stamp_delay_s, str)
        self._loop_hz: float | None = None
        self._plane = False
        self.in_step = False
        """Whether stamps are synchronous with sampling."""
        self.delay_s = COPTER_DELAY_S if isinstance(attitude_stamp_delay_s, str) else attitude_stamp_delay_s
        self.correction_ns = self._correction_ns()
        """Nanoseconds to add to a stamp for the mean instant of its attitude."""

    def _correction_ns(self) -> int:
        if self.in_step and (self._automatic or self.delay_s == 0.0):
            return 0
        return HALF_MS_NS - round(self.delay_s * 0.5e9)

    @property
    def sigma_s(self) -> float:
        """One sigma of the instant of an interpolated attitude, seconds."""
        return SAMPLES_SHARE * sqrt((CUT_S * CUT_S + self.delay_s * self.delay_s) / 12.0)

    def on_heartbeat(self, autopilot: int, vehicle_type: int) -> int:
        """Take a HEARTBEAT. Returns the change of the correction, nanoseconds."""
        return self._settle(
            self._loop_hz, self._plane or (autopilot == AUTOPILOT_ARDUPILOT and vehicle_type in PLANE_TYPES)
        )

    def on_text(self, text: str) -> int:
        """Take a STATUSTEXT: ArduPlane's banner names the firmware. Returns the change of the correction, ns."""
        return self._settle(self._loop_hz, self._plane or text.startswith("ArduPlane V"))

    def on_parameter(self, name: str, value: float) -> int:
        """Take a parameter: SCHED_LOOP_RATE gives the exact delay. Returns the change of the correction, ns."""
        if name.rstrip("\0") != "SCHED_LOOP_RATE" or not SLOWEST_LOOP_HZ <= value <= FASTEST_LOOP_HZ:
            return 0
        return self._settle(float(value), self._plane)

    def on_scatter(self, scatter_s: float) -> int:
        """Take the bound of the stamps' scatter from the attitudes, s. Returns the change of the correction, ns."""
        self.in_step = scatter_s < (OUT_OF_STEP_S if self.in_step else IN_STEP_S)
        return self._moved_ns()

    def _settle(self, loop_hz: float | None, plane: bool) -> int:
        self._loop_hz, self._plane = loop_hz, plane
        if not self._automatic:
            return 0
        if loop_hz is not None:
            self.delay_s = 1.0 / loop_hz
        else:
            self.delay_s = PLANE_DELAY_S if plane else COPTER_DELAY_S
        return self._moved_ns()

    def _moved_ns(self) -> int:
        before_ns, self.correction_ns = self.correction_ns, self._correction_ns()
        return self.correction_ns - before_ns
