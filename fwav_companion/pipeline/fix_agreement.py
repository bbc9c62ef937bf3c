"""Agreement of the fixes of one target from frame to frame: a wrong mount moves them by metres in flight. Pure.

Two fixes of a target at rest differ by their noise and by the parts of their biases that they do not share. The
normalised square of that difference (2 degrees of freedom) exceeds 5.99 once in twenty pairs; where many pairs exceed
it, an error is larger than [uncertainty] allows. A label (with the detector's id, if it sends one) is used only if it
occurs once in a frame, so that two targets are not taken for one. The share and the median tolerate false detections in
frames without the target.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import cos, exp, hypot, inf, pi, sin
from statistics import median
from typing import TypeAlias

from fwav_companion.geometry.small_matrices import squared_distance
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3, multiply, transform, transpose
from fwav_companion.types import Bias, ErrorPriors, GroundFix
from fwav_companion.types.flight_status import AgreementReport

STEP_NS = 55_000_000
"""Least time between two kept fixes: every second frame of 30 a second, three phases of a wing beat of 5 Hz."""
KEPT = 60
"""Most kept fixes of each target."""
MOST_TARGETS = 8
LONGEST_NS = 8_000_000_000
"""Greatest age of a compared fix: a receiver's position wanders little meanwhile."""
FEWEST = 30
"""Least number of fixes for a comparison."""
APART = 5.99
"""Normalised squared difference beyond which two fixes disagree: chi-square, 2 degrees of freedom, 95 %."""
QUARTER_TURNS = (90.0, 180.0, -90.0)
"""Turns of the mount about the body's down axis that are tried, degrees: the usual mistakes."""
MANY_APART = 0.4
"""Share of disagreeing fixes beyond which a turn of the mount is searched. With the mock, the share is at most 0.3 in
healthy flights, 0.45 and more with a mount turned by 90 deg."""
MENDED = 0.5
"""Factor on the spread of the fixes: a quarter turn that reduces it below this factor is the likely mistake."""

Horizontal: TypeAlias = tuple[float, float]
Target: TypeAlias = tuple[str, int | None]
"""Label and detector's id."""


class FixAgreement:
    """Keeps the fixes of the last seconds; :meth:`status` compares them."""

    def __init__(self, priors: ErrorPriors) -> None:
        self._variances = tuple(priors.sigma(bias) ** 2 for bias in Bias)
        self._wander = (priors.sigma(Bias.POSITION_NORTH) ** 2, priors.position_bias_time_s)
        self._kept: dict[Target, deque[GroundFix]] = {}
        self._last_ns = HostNs(0)

    def add(self, fixes: Sequence[GroundFix], host_ns: HostNs) -> None:
        """Take the fixes of one frame."""
        if not fixes or abs(host_ns - self._last_ns) < STEP_NS:
            return
        self._last_ns = host_ns
        seen: dict[Target, GroundFix | None] = {}  # None: more than once
        for fix in fixes:
            target = (fix.sighting.detection.label, fix.sighting.detection.detector_id)
            seen[target] = None if target in seen or fix.sighting.relative else fix
        alone = [(target, fix) for target, fix in seen.items() if fix is not None]
        for target, fix in alone[:MOST_TARGETS]:
            self._of(target).append(fix)

    def _of(self, target: Target) -> deque[GroundFix]:
        """Return the kept fixes of one target, and make it the newest; the target seen longest ago makes room."""
        kept = self._kept.pop(target, None)
        if kept is None:
            kept = deque(maxlen=KEPT)
            if len(self._kept) >= MOST_TARGETS:
                del self._kept[next(iter(self._kept))]
        self._kept[target] = kept
        return kept

    def status(self) -> AgreementReport:
        """Return how many fixes were compared, which share disagrees, and by how much, for the status."""
        fixes = max((self._recent(kept) for kept in self._kept.values()), key=len, default=[])
        if len(fixes) < FEWEST:
            return AgreementReport()
        points = [_horizontal(fix.position_ned) for fix in fixes]
        middle = _middle(points)
        reference = min(fixes, key=lambda fix: _distance(_horizontal(fix.position_ned), middle))
        apart = [self._normalised(fix, reference) > APART for fix in fixes if fix is not reference]
        share = sum(apart) / len(apart)
        return AgreementReport(
            compared=len(apart),
            apart=share,
            apart_m=median(_distance(point, middle) for point in points),
            turn_deg=_quarter_turn(fixes, points) if share > MANY_APART else None,
            label=fixes[0].sighting.detection.label,
        )

    def _recent(self, kept: deque[GroundFix]) -> list[GroundFix]:
        return [fix for fix in kept if self._last_ns - fix.sighting.frame_host_ns <= LONGEST_NS]

    def _normalised(self, a: GroundFix, b: GroundFix) -> float:
        """Return the normalised square of the horizontal difference of two fixes."""
        variance_m2, time_s = self._wander
        apart_s = abs(a.sighting.host_ns - b.sighting.host_ns) * 1e-9
        wandered = 2.0 * variance_m2 * (1.0 - exp(-apart_s / time_s))
        nn = a.noise_cov[0][0] + b.noise_cov[0][0] + wandered
        ne = a.noise_cov[0][1] + b.noise_cov[0][1]
        ee = a.noise_cov[1][1] + b.noise_cov[1][1] + wandered
        for variance, one, other in zip(self._variances, a.bias_jacobian, b.bias_jacobian, strict=True):
            north, east = one[0] - other[0], one[1] - other[1]
            nn += variance * north * north
            ne += variance * north * east
            ee += variance * east * east
        north, east = (p - q for p, q in zip(a.position_ned[:2], b.position_ned[:2], strict=True))
        return squared_distance(north, east, (nn, ne, ee))


def _quarter_turn(fixes: Sequence[GroundFix], points: Sequence[Horizontal]) -> float | None:
    """Return the quarter turn of the mount, degrees, with which the same pixels agree; None if there is none."""
    spreads = {turn: _spread(_turned(fixes, turn)) for turn in QUARTER_TURNS}
    best = min(spreads, key=spreads.__getitem__)
    return best if spreads[best] < MENDED * _spread(points) else None


def _turned(fixes: Sequence[GroundFix], turn_deg: float) -> list[Horizontal]:
    """Return the rays' intersections with the level of their fixes, the mount turned about the body's down axis."""
    c, s = cos(turn_deg * pi / 180.0), sin(turn_deg * pi / 180.0)
    about_down: Matrix3 = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
    points = []
    for fix in fixes:
        sighting = fix.sighting
        ned_from_body = multiply(sighting.ned_from_camera, transpose(sighting.body_from_camera))
        in_body = transform(sighting.body_from_camera, sighting.ray.direction)
        north, east, down = transform(multiply(ned_from_body, about_down), in_body)
        if down > 0.05:
            along_m = (fix.position_ned[2] - sighting.camera_ned[2]) / down
            points.append((sighting.camera_ned[0] + along_m * north, sighting.camera_ned[1] + along_m * east))
    return points


def _spread(points: Sequence[Horizontal]) -> float:
    """Return the median distance from the middle; inf for too few points."""
    if len(points) < FEWEST:
        return inf
    middle = _middle(points)
    return median(_distance(point, middle) for point in points)


def _middle(points: Sequence[Horizontal]) -> Horizontal:
    return median(north for north, _ in points), median(east for _, east in points)


def _distance(a: Horizontal, b: Horizontal) -> float:
    return hypot(a[0] - b[0], a[1] - b[1])


def _horizontal(position: Vector3) -> Horizontal:
    return position[0], position[1]
