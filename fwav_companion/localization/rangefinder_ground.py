"""The level ground at the height that the rangefinder measures; the home surface where it has no reading."""

from __future__ import annotations

from collections import Counter
from math import hypot, sqrt

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.rotations import exp, multiply, rotate
from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.geometry.vectors import Vector3, norm, scale
from fwav_companion.localization.ground import HomeGround, Intersection, camera_above_flat, flat_distance
from fwav_companion.types import GroundReference, HeightReference, NoFix, RangeSample, Reason, Sighting, TakeOff
from fwav_companion.types.flight_status import GroundReport

LEAST_PLUMB = 0.5
"""Least down component of the unit beam: beyond 60 degrees of tilt it measures the ground at another place."""
OLDEST_S = 0.3
"""Largest age of a reading at the capture, seconds: within it a vehicle that sinks at 2 m/s moves by 0.6 m."""
TURN_DOUBT = 0.5
"""One sigma of the turn between reading and capture, as a fraction of that turn: rates of flapping do not persist."""


class RangefinderGround:
    """The level surface at the rangefinder's height below the camera, corrected for tilt."""

    def __init__(self, height_noise_m: float) -> None:
        """``height_noise_m``: one sigma of a reading without a sigma of its own."""
        self._noise_m = height_noise_m
        self._home = HomeGround()
        self.fallback: Reason | None = None
        """Reason why the last ray was intersected with the home surface; None where it was not."""
        self.fallbacks: Counter[Reason] = Counter()
        """Number of rays intersected with the home surface, by reason."""

    def home_moved(self, home_down_m: float) -> None:
        """Set the depth of the home surface, which replaces missing readings."""
        self._home.home_moved(home_down_m)

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:
        """Do nothing: the surface does not depend on the origin."""
        return self._home.on_origin(plane, take_off, undulation_m)

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection by a fresh reading whose beam points down; else with the home surface."""
        reading = sighting.state.range
        age_s = 0.0 if reading is None else s_from_ns(reading.boot_ns - sighting.state.boot_ns)
        if reading is None or abs(age_s) > OLDEST_S:
            return self._meet_home(Reason.NO_RANGE, sighting, direction)
        beam = _beam_ned(reading, sighting, age_s)
        if beam[2] < LEAST_PLUMB:
            return self._meet_home(Reason.RANGE_TILTED, sighting, direction)
        self.fallback = None
        return self._meet_reading(reading, beam, age_s=age_s, sighting=sighting, direction=direction)

    def status(self) -> GroundReport:
        """Name of the model, reason for the home surface now, and counts of these reasons."""
        return GroundReport(
            model="rangefinder",
            fallback=None if self.fallback is None else self.fallback.value,
            fallbacks={reason.value: count for reason, count in sorted(self.fallbacks.items())},
        )

    def reference(self) -> GroundReference:
        """The rangefinder's height, and before its first reading the home surface."""
        return GroundReference(HeightReference.RANGE, self._home.reference().level_m)

    def _meet_home(self, why: Reason, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        self.fallback = why
        self.fallbacks[why] += 1
        return self._home.meet(sighting, direction)

    def _meet_reading(
        self, reading: RangeSample, beam: Vector3, age_s: float, sighting: Sighting, direction: Vector3
    ) -> Intersection | NoFix:
        velocity = sighting.state.velocity_ned
        sunk_m = 0.0 if velocity is None else velocity[2] * age_s
        height_m = reading.distance_m * beam[2] + sunk_m
        distance_m = flat_distance(direction, height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        turned = TURN_DOUBT * norm(sighting.state.rates) * abs(age_s)
        by_turn_m = reading.distance_m * hypot(beam[0], beam[1]) * turned
        along_m = (reading.sigma_m or self._noise_m) * beam[2]
        return Intersection(
            camera_above_flat(sighting, height_m),
            distance_m,
            height_m,
            "rangefinder",
            moves_with_camera=True,
            height_noise_m=sqrt(along_m**2 + by_turn_m**2),
            height_by_rotation=(reading.distance_m * beam[1], -reading.distance_m * beam[0], 0.0),
        )


def _beam_ned(reading: RangeSample, sighting: Sighting, age_s: float) -> Vector3:
    """The unit vector along the beam at the reading, NED, by attitude and rates at the capture."""
    q = multiply(sighting.state.ned_from_body, exp(scale(sighting.state.rates, age_s)))
    return rotate(q, reading.beam_in_body)
