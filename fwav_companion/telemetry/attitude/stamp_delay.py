"""How late an attitude is stamped: by the loop that packs the message, and by cutting the stamp to milliseconds."""

from __future__ import annotations

from math import sqrt

HALF_MS_NS = 500_000
"""A stamp cut to whole milliseconds is 0.5 ms early on average."""
CUT_S = 1e-3

COPTER_DELAY_S = 0.0025
"""One loop of an ArduCopter at 400 Hz; PX4's is no longer."""
PLANE_DELAY_S = 0.02
"""One loop of an ArduPlane at 50 Hz."""

AUTOPILOT_ARDUPILOT = 3
PLANE_TYPES = frozenset({1, 19, 20, 21, 22, 23, 24, 25})
"""What ArduPlane tells itself to be: MAV_TYPE_FIXED_WING, or a VTOL. FLAPPING_WING is no firmware's name of itself."""
SLOWEST_LOOP_HZ, FASTEST_LOOP_HZ = 25.0, 8000.0

IN_STEP_S, OUT_OF_STEP_S = 1.2e-4, 2.0e-4
"""Cutting stamps of any instant to milliseconds alone scatters them by 0.29 ms RMS."""

SAMPLES_SHARE = 0.8
"""Interpolation through samples whose stamps err independently averages them: sqrt(sum of squared weights)."""


class AttitudeStamps:
    """An attitude is older than its stamp by up to ``delay_s``, uniformly: the mean is corrected, the rest is told.

    Where the attitudes show that stamps do not scatter at all, that mean is none: stamp and attitude keep step, at an
    interval that attitudes cannot show, and the stamp is taken at its word. A simulator that samples on whole
    milliseconds is then placed exactly, and a scheduler that never varies as well as anybody can tell. A delay that was
    configured, unless it is 0, is always believed.
    """

    __slots__ = ("_automatic", "_loop_hz", "_plane", "delay_s", "in_step")

    def __init__(self, attitude_stamp_delay_s: float | str) -> None:
        self._automatic = isinstance(attitude_stamp_delay_s, str)
        self._loop_hz: float | None = None
        self._plane = False
        self.in_step = False
        """The stamps do not scatter."""
        self.delay_s = COPTER_DELAY_S if isinstance(attitude_stamp_delay_s, str) else attitude_stamp_delay_s

    @property
    def correction_ns(self) -> int:
        """To be added to a stamp for the mean instant of its attitude."""
        if self.in_step and (self._automatic or self.delay_s == 0.0):
            return 0
        return HALF_MS_NS - round(self.delay_s * 0.5e9)

    @property
    def sigma_s(self) -> float:
        """One sigma of the instant that is left open, of an interpolated attitude."""
        return SAMPLES_SHARE * sqrt((CUT_S * CUT_S + self.delay_s * self.delay_s) / 12.0)

    def on_heartbeat(self, autopilot: int, vehicle_type: int) -> int:
        """By how many nanoseconds the correction moved."""
        return self._settle(
            self._loop_hz, self._plane or (autopilot == AUTOPILOT_ARDUPILOT and vehicle_type in PLANE_TYPES)
        )

    def on_text(self, text: str) -> int:
        """ArduPlane names itself in its banner. By how many nanoseconds the correction moved."""
        return self._settle(self._loop_hz, self._plane or text.startswith("ArduPlane V"))

    def on_parameter(self, name: str, value: float) -> int:
        """SCHED_LOOP_RATE tells it exactly. By how many nanoseconds the correction moved."""
        if name.rstrip("\0") != "SCHED_LOOP_RATE" or not SLOWEST_LOOP_HZ <= value <= FASTEST_LOOP_HZ:
            return 0
        return self._settle(float(value), self._plane)

    def on_scatter(self, scatter_s: float) -> int:
        """How far stamps can scatter, by the attitudes' course. By how many nanoseconds the correction moved."""
        before_ns = self.correction_ns
        self.in_step = scatter_s < (OUT_OF_STEP_S if self.in_step else IN_STEP_S)
        return self.correction_ns - before_ns

    def _settle(self, loop_hz: float | None, plane: bool) -> int:
        self._loop_hz, self._plane = loop_hz, plane
        if not self._automatic:
            return 0
        before_ns = self.correction_ns
        if loop_hz is not None:
            self.delay_s = 1.0 / loop_hz
        else:
            self.delay_s = PLANE_DELAY_S if plane else COPTER_DELAY_S
        return self.correction_ns - before_ns
