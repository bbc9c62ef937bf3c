"""Mean and covariance of the errors that all targets share, and the record of each landmark. Immutable."""

from __future__ import annotations

from math import hypot, sqrt
from typing import Self

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.landmarks.joint_place import Step, stepped
from fwav_companion.tracking.landmarks.state_vector import ALTITUDE_SHARE, SharedErrors
from fwav_companion.types import LandmarkAltitude, LandmarkRecord, LandmarkState

IN_A_ROW = 5
"""Number of refused sights in a row after which the landmark, and not the detector, is in doubt."""


class Sequel(msgspec.Struct, frozen=True, gc=False):
    """State of the series of sights of one landmark, which its next sight continues."""

    at_ns: HostNs
    """Capture of the last sight."""
    in_a_row: int = 0
    """Number of refused sights since the last sight that agreed."""


class LandmarkEstimate(msgspec.Struct, frozen=True):
    """Estimate of the shared errors at one instant."""

    model: SharedErrors
    mean: Array
    cov: Array
    sigma_m: float
    """One sigma of the vehicle's position by its receiver, metres an axis."""
    records: tuple[LandmarkRecord, ...]
    sequels: tuple[Sequel | None, ...]
    doubted: tuple[int, int] = (-1, 0)
    """Index of the landmark in doubt, -1 for none; number of examinations in a row that found it in doubt."""
    unresolved: int = 0
    """Number of examinations in a row that found landmarks in contradiction."""
    suspects: tuple[int, ...] = ()
    """Landmarks in use that the others contradict: each may be the wrong one."""
    steps: tuple[Step, ...] = ()
    """The newest steps, in order, to be applied to the places of the targets."""

    @property
    def shows(self) -> bool:
        """Whether any landmark was seen and is used."""
        return any(record.state is LandmarkState.USED for record in self.records)

    @property
    def altitude(self) -> LandmarkAltitude | None:
        """The vehicle's altitude by sights of the landmark that was used most; None before :data:`IN_A_ROW` sights.

        The prior is removed with its information, because the error of an altitude above sea level may be more than
        twice the error of the place.
        """
        used = max(range(len(self.records)), key=lambda i: self.records[i].used * self._is_used(i))
        if not self._is_used(used) or self.records[used].used < IN_A_ROW:
            return None
        index, prior = self.model.altitude, (ALTITUDE_SHARE * self.sigma_m) ** 2
        variance = float(self.cov[index, index])
        if not variance < prior:
            return None
        shown = 1.0 / (1.0 / variance - 1.0 / prior)
        sigma_m = hypot(sqrt(shown), self.model.landmarks[used].sigma_m)
        return LandmarkAltitude(used, float(self.mean[index]) * shown / variance, sigma_m)

    def _is_used(self, landmark: int) -> bool:
        return self.records[landmark].state is LandmarkState.USED

    @property
    def shared(self) -> tuple[Array, Array]:
        """Mean and covariance of the shared errors."""
        return self.mean, self.cov

    def after(self, step: Step) -> Self:
        """The state after a step, which is also kept for the places of the targets."""
        mean, cov = stepped(self.shared, step, self.model.estimated)
        return replace(self, mean=mean, cov=cov, steps=(*self.steps, step))

    def recorded(self, landmark: int, record: LandmarkRecord, sequel: Sequel | None = None) -> Self:
        """The state with a new record of one landmark and, where one is given, a new sequel."""
        records = (*self.records[:landmark], record, *self.records[landmark + 1 :])
        if sequel is None:
            return replace(self, records=records)
        sequels = (*self.sequels[:landmark], sequel, *self.sequels[landmark + 1 :])
        return replace(self, records=records, sequels=sequels)
