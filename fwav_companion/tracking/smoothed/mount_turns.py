"""A camera that is turned or looks elsewhere than configured: named, not estimated.

Under the right mount the sights of a static target meet on the ground. Under a mount that is wrong by a quarter turn
they scatter: no association, no solve. So sights are kept whether or not a track took them, and are clustered under
each quarter turn (``initiation``), one hypothesis a frame. A turn that explains more of them than the configured mount
is reported by its name.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fwav_companion.estimation.array_rotations import rotation_and_jacobian
from fwav_companion.estimation.errors import CAMERA_DELAY, MOUNT, Array
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.initiation import Clustering, cluster, quarter_turns, sight_poses
from fwav_companion.estimation.kept_sightings import Sightings, joined, spread
from fwav_companion.estimation.measurement import Poses
from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.self_calibration.named_mounts import named

EVERY_NS = 200 * NS_PER_MS
"""Least time between two frames whose sights are kept: sixty of them span many headings."""
MOST_KEPT = 240
"""Sights that are kept: of five targets those of ten seconds."""
MOST_JUDGED, LEAST_JUDGED = 60, 24
"""Most and least sights of one label that are judged, evenly over those that are kept."""
FRESH = 8
"""Frames with new sights between two judgements."""
AXIS = 2
"""The camera looks along its z axis."""


@dataclass(frozen=True)
class JudgedTurns:
    """Hypotheses under judgement: the same sights under one turn after the other."""

    sights: Sightings
    poses: Poses
    turns: tuple[Array, ...]
    found: tuple[Clustering, ...] = ()


@dataclass
class MountTurns:
    """The kept sights, and what they say of the mount."""

    body_from_camera: Matrix3 | None = None
    mistake: str = ""
    """The mistake of the mount in words; empty where there is none."""
    misplaced_m: float = 0.0
    """One sigma of the resulting error of places, each axis, m; 0 without a mistake."""
    _kept: deque[tuple[str, Sightings]] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))
    _last_ns: int = 0
    _fresh: int = 0
    _judged: JudgedTurns | None = None

    def copy(self) -> MountTurns:
        """A snapshot."""
        return replace(self, _kept=self._kept.copy())

    def add(self, labels: Sequence[str], sights: Sightings, mount: Matrix3, host_ns: HostNs) -> None:
        """Keep the sights of a frame's static targets, at most five frames a second."""
        if host_ns - self._last_ns < EVERY_NS:
            return
        self._last_ns, self.body_from_camera = host_ns, mount
        for i, label in enumerate(labels):
            self._kept.append((label, sights.select(np.array([i]))))
        self._fresh += 1

    def judge(self, estimator: Estimator) -> None:
        """Try one hypothesis; with the last one, judge."""
        judged = self._judged or self._started(estimator)
        if judged is None:
            return
        turn = judged.turns[len(judged.found)]
        priors, noise = estimator.model.priors, estimator.model.noise
        found = cluster(
            estimator.model, judged.poses, judged.sights, priors.mean, np.diag(priors.sigma**2), np.zeros(3), turn,
            wander_m=noise.position_wander_m, beats=max([each.score for each in judged.found], default=-np.inf),
        )  # fmt: skip
        self._judged = replace(judged, found=(*judged.found, found))
        if len(judged.found) + 1 == len(judged.turns):
            self._conclude(self._judged)
            self._judged = None

    def _started(self, estimator: Estimator) -> JudgedTurns | None:
        """A judgement of the label that is seen most, where there are enough new sights and the mount is not known."""
        if self._fresh < FRESH or self.body_from_camera is None or not estimator.carrier.shows_motion():
            return None
        label, count = Counter(label for label, _ in self._kept).most_common(1)[0]
        if count < LEAST_JUDGED:
            return None
        self._fresh = 0
        if not self.mistake and _shows_mount(estimator):
            return None
        sights = spread(joined([s for each, s in self._kept if each == label]), MOST_JUDGED, -np.inf)
        axis = np.array(self.body_from_camera)[:, AXIS]
        poses = sight_poses(estimator.carrier, sights, estimator.model.priors.mean)
        return JudgedTurns(sights, poses, tuple(quarter_turns(axis)))

    def _conclude(self, judged: JudgedTurns) -> None:
        configured, best = judged.found[0], max(judged.found, key=lambda found: found.score)
        if not best.turn.any() or self.body_from_camera is None:
            self.mistake, self.misplaced_m = "", 0.0
            return
        mount = np.array(self.body_from_camera)
        true_mount = rotation_and_jacobian(-best.turn)[0] @ mount
        self.mistake = named(mount, np.asarray(true_mount))
        both = configured.meets & best.meets
        off = (configured.places - best.places)[:, both]
        self.misplaced_m = float(np.sqrt(0.5 * (off * off).sum(0).mean())) if both.any() else 0.0


def _shows_mount(estimator: Estimator) -> bool:
    """Whether the flight itself shows delay and mount, as configured: then the camera is not turned."""
    statuses = estimator.self_calibration()
    shown = all(statuses[i].is_known for i in (CAMERA_DELAY, *range(MOUNT.start, MOUNT.stop)))
    return shown and all(each.status != "contradicts" for each in statuses)
