"""Detection of gross mistakes in the mount, which are reported rather than estimated: an image upside down, turned or
mirrored, or a camera that looks elsewhere than configured.

The sights of a static target meet on the ground under the right mount. Under a wrong one they scatter over the field,
too far for any confirmed track. So single sights are kept whether or not they belong to a track, and are tried under
other mounts. A mount under which they meet is reported, and so is the resulting error of all published places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S
from fwav_companion.self_calibration.arrays import EYE, Array, rotation, times
from fwav_companion.self_calibration.calibration_context import mount_sigmas
from fwav_companion.self_calibration.mount_search import SMALL_STEPS, STARTS, STEPS, searched
from fwav_companion.self_calibration.named_mounts import CANDIDATES, angle, named, turned
from fwav_companion.self_calibration.sights import (
    CommonPoint,
    Sights,
    SingleSight,
    expected_spread,
    sight_of,
    sights_of,
)
from fwav_companion.types import Bias, ErrorPriors, GroundFix, VehicleState

EVERY_NS = 200 * NS_PER_MS
"""Least time between two sights that are kept: sixty of them span many headings."""
MOST_KEPT = 80
LEAST_KEPT = 30
"""Most sights kept, and sights of one label that a judgement needs."""
FRESH = 10
"""New sights between two judgements: two seconds and more."""
PREDICTED_NS = 3 * NS_PER_S
"""Time over which a mount must predict the sights: a walking person is 4 m away after it."""
LEAST_FITTED, LEAST_PREDICTED = 15, 8
"""Least sights that a mount is fitted to, and least later sights that it must predict."""
ANOTHER_DELAY_S = 0.01
"""Change of the delay, s, beyond which the earlier sights belong to other attitudes and are dropped."""
WILD = 0.12
"""Spread under the configured mount, rad, above which another mount is searched. A delay of 35 ms causes as much on a
flapping camera, a mount off by a few degrees less. No other mount reduces either spread."""
DISPLACED = 3.0
"""Ratio of the spread to the one expected of a right mount, above which another mount is searched. A distance drawn
from the same normal errors is larger once in 500 times (Rayleigh distribution). Near the ground small distances are
large angles: over a descent to 1 m with a position that wandered by 1 m the sights spread by 0.3 rad, and met under a
mount off by 106 degrees."""
CLOSE = 0.08
"""Spread up to which sights meet, rad: a delay of 35 ms leaves 0.07 on a flapping camera, a metre of position wander
0.05."""
GATHERED = 0.45
"""Ratio of a candidate's spread to that of the configured mount, below which the candidate explains the sights: a metre
of position wander remains even with the right mount."""
AS_GOOD, SHARP = 1.25, 0.02
"""Ratio of the spread to that of the mounts near it, and spread in rad (a degree, as pixel noise leaves), up to either
of which a turned image or a likely mount is the simpler explanation."""
AS_EXPECTED = 1.9
"""Ratio of the spread to the one expected of a right mount, below which 99 % of right mounts are: of 16 000 drawn
wanders of 20 and 60 s over 6 and 16 s. A turned image that is within it needs no other error: a mount that is fitted to
the wander meets more closely, and is wrong."""
SMALL = radians(8.0)
"""Mount error, rad: where the sights also meet under a mount off by less, there is no gross mistake, because few views
hardly distinguish the mounts. Self-calibration finds that mount, and the targets have wide covariances until then."""
LIKELY = 14.2
"""Squared Mahalanobis distance from the configured mount, 3 degrees of freedom, up to which the priors of mount,
attitude and heading, and so all covariances, include a mount: right priors exceed it once in 400 flights. Of fifty
eights and racetracks drawn from the priors, one, with a heading off by 5.4 degrees for a sigma of 2, had no fix in its
last 20 s."""
KNOWN = 1e-6
"""One sigma assumed for an angle that is configured as exactly known, rad."""


class MountMistake(msgspec.Struct, frozen=True):
    """A mount that explains the sights where the configured one does not."""

    common: CommonPoint
    """The mount, and the point where the sights meet under it."""
    text: str
    """The mistake as a sentence for users; empty where it is not gross."""
    misplaced_m: float
    """Median distance of the published places from the common point, m."""


class MountCheck(msgspec.Struct, frozen=True):
    """The kept single sights, and the mount mistake that they show. Immutable."""

    predicted_ns: int = PREDICTED_NS
    """Time over which a mount must predict the sights before it is accepted."""
    sights: tuple[SingleSight, ...] = ()
    fresh: int = 0
    """Sights kept since the last judgement."""
    delay_s: float = 0.0
    """Delay at which the poses of the sights were taken, s."""
    mistake: MountMistake | None = None
    """Result of the last judgement."""

    @property
    def text(self) -> str:
        """The gross mistake, as a sentence; empty where there is none."""
        return "" if self.mistake is None else self.mistake.text

    def seen(
        self,
        fixes: Sequence[GroundFix],
        state_at_capture: Callable[[VehicleState], VehicleState],
        delay_s: float,
        priors: ErrorPriors,
    ) -> MountCheck:
        """The check after one frame. Only a frame with a single fix is used, because then its target is not in doubt.

        ``state_at_capture``: gives the vehicle's state at a capture corrected by ``delay_s``, the delay known by now.
        """
        if len(fixes) != 1 or (self.sights and fixes[0].sighting.frame_host_ns - self.sights[-1].host_ns < EVERY_NS):
            return self
        sight = sight_of(fixes[0], state_at_capture(fixes[0].sighting.state), priors)
        if self.sights and abs(delay_s - self.delay_s) > ANOTHER_DELAY_S:
            return msgspec.structs.replace(self, sights=(sight,), fresh=0, delay_s=delay_s)
        sights, fresh = (*self.sights, sight)[-MOST_KEPT:], self.fresh + 1
        after = msgspec.structs.replace(self, sights=sights, fresh=fresh, delay_s=delay_s)
        own = [each for each in sights if each.label == sight.label]
        if len(own) < LEAST_KEPT or fresh < FRESH:
            return after
        judged = _judged(own, self.mistake, self.predicted_ns, priors)
        return msgspec.structs.replace(after, fresh=0, mistake=judged)


def _judged(
    sights: Sequence[SingleSight], before: MountMistake | None, predicted_ns: int, priors: ErrorPriors
) -> MountMistake | None:
    """The mistake that these sights show if they spread far under the configured mount. The one found ``before``
    remains until the spread under the configured mount is smaller than under the found one by the same ratio
    (GATHERED).
    """
    seen, expected = sights_of(sights), expected_spread(sights, priors)
    wild = max(WILD, DISPLACED * expected)
    (configured,) = seen.meeting(np.array([sights[-1].body_from_camera]))
    if before is not None:
        (common,) = seen.meeting(before.common.body_from_camera[None])
        cleared = configured.spread < GATHERED * common.spread
        before = None if cleared else _mistake(seen, configured, common, before.text)
    if configured.spread < wild or (before is not None and before.text):
        return before
    image = _image(seen, configured, expected)
    if image is not None:
        return _mistake(seen, configured, *image)
    if _is_within_priors(seen, configured, sights[-1], priors):
        return before
    suspect = _predicting(sights, configured, predicted_ns)
    if suspect is None:
        return before
    common = searched(seen, suspect.body_from_camera[None], SMALL_STEPS)
    return _mistake(seen, configured, common, named(configured.body_from_camera, common.body_from_camera))


def _mistake(seen: Sights, configured: CommonPoint, common: CommonPoint, text: str) -> MountMistake:
    return MountMistake(common, text, seen.misplaced_m(common, configured.body_from_camera))


def _enough(configured: CommonPoint) -> float:
    """The spread, rad, below which another mount explains the sights better than the configured one."""
    return min(CLOSE, GATHERED * configured.spread)


def _image(seen: Sights, configured: CommonPoint, expected: float) -> tuple[CommonPoint, str] | None:
    """The turned or mirrored image that explains these sights; None without one.

    It does if they spread as ``expected`` (rad) of a right mount, or no more than under mounts a little off. Of two
    images that are about as good, the first of the candidates is the likelier mistake.
    """
    mount = configured.body_from_camera
    images = seen.meeting(np.array([turned(mount, turn) for _, turn in CANDIDATES]))
    as_good = AS_GOOD * min(each.spread for each in images)
    best, text = next(
        (each, text) for each, (text, _) in zip(images, CANDIDATES, strict=True) if each.spread <= as_good
    )
    if best.spread >= _enough(configured):
        return None
    if best.spread < max(SHARP, AS_EXPECTED * expected):
        return best, text
    others = searched(seen, np.array([mount, best.body_from_camera]), SMALL_STEPS)
    return (best, text) if best.spread < AS_GOOD * others.spread else None


def _predicting(sights: Sequence[SingleSight], configured: CommonPoint, predicted_ns: int) -> CommonPoint | None:
    """A mount fitted to the earlier sights that predicts the last ones; None without one.

    Three parameters can be fitted to many paths, also to that of a walking target. The fitted mount then predicts an
    earlier place of that target.
    """
    until_ns = sights[-1].host_ns - predicted_ns
    earlier = [each for each in sights if each.host_ns <= until_ns]
    last = sights[len(earlier) :]
    if len(earlier) < LEAST_FITTED or len(last) < LEAST_PREDICTED:
        return None
    seen = sights_of(earlier)
    suspect = _suspect(seen, seen.meeting(configured.body_from_camera[None])[0])
    return suspect if suspect is not None and sights_of(last).missed(suspect) < _enough(configured) else None


def _suspect(seen: Sights, configured: CommonPoint) -> CommonPoint | None:
    """A mount that explains these sights, preferably one near the configured one; None without one."""
    mount = configured.body_from_camera
    near = searched(seen, mount[None], SMALL_STEPS, lambda each: angle(mount, each) <= SMALL)
    if near.spread < _enough(configured):
        return near
    found = searched(seen, times(rotation(STARTS), mount), STEPS)
    return found if found.spread < _enough(configured) else None


def _is_within_priors(seen: Sights, configured: CommonPoint, sight: SingleSight, priors: ErrorPriors) -> bool:
    """Whether a mount that is likely by the priors explains the sights as well as any mount near it.

    The priors are those of all rotations common to the sights: the mount, roll and pitch, and the heading about down.
    """
    heading = priors.sigma(Bias.HEADING) * np.array(sight.ned_from_body)[2]
    cov = np.diag(mount_sigmas(priors)) ** 2 + heading[:, None] * heading
    information = np.linalg.inv(cov + KNOWN**2 * EYE)

    def is_likely(mount: Array) -> bool:
        turn = mount @ configured.body_from_camera.T
        off = 0.5 * np.array((turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]))
        return bool(off @ information @ off < LIKELY)

    likely = searched(seen, configured.body_from_camera[None], SMALL_STEPS, is_likely)
    if likely.spread >= _enough(configured):
        return False
    return likely.spread < max(SHARP, AS_GOOD * searched(seen, likely.body_from_camera[None], SMALL_STEPS).spread)
