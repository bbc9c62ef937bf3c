"""What self-calibration tells, and what of it is kept for the next flight."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tracking.answer import MOUNT
from fwav_companion.tracking.loosening import Loosening
from fwav_companion.tracking.rays import Common
from fwav_companion.tracking.verdict import CalibrationStatus, Verdict


class KeptCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """A calibration of an earlier flight, as a narrower prior than the configuration's.

    Its mount is as uncertain as the heading leaves it: another flight has another error of heading.
    """

    time_offset_s: float
    time_offset_sigma_s: float
    mount: Vector3
    mount_sigma: Vector3

    @property
    def is_sound(self) -> bool:
        """Finite, with sigmas that are some: a file may have been written by anybody."""
        numbers = (self.time_offset_s, *self.mount)
        sigmas = (self.time_offset_sigma_s, *self.mount_sigma)
        return all(map(isfinite, numbers)) and all(isfinite(sigma) and sigma > 0.0 for sigma in sigmas)


class CalibrationReport(msgspec.Struct, frozen=True, kw_only=True):
    """What self-calibration knows: corrections to what was configured."""

    host_ns: HostNs
    time_offset_s: float
    """To be added to the configured time offset."""
    time_offset_sigma_s: float
    mount: Vector3
    """Rotation vector, body axes, rad: the true mount is Exp(mount) times the configured one."""
    mount_sigma: Vector3
    height_m: float
    """Told minus true."""
    height_sigma_m: float
    status: CalibrationStatus
    rivals: tuple[float, ...] = ()
    """Of AMBIGUOUS: corrections of the time offset that explain what was seen alike, the likeliest first."""
    mistake: str = ""
    """A gross mistake in the mount, as a sentence; nothing is estimated then."""
    denied: tuple[Loosening, ...] = ()
    """Priors of mount and height that this flight denies: it was believed instead."""
    replaced: bool = False
    """What an earlier flight found was denied by this one, and dropped."""
    keep: KeptCalibration | None = None
    """What is worth keeping for the next flight; None while that is nothing."""


def believed(
    verdict: Verdict | None, means: Sequence[float], sigmas: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Mean and one sigma of each of the common unknowns; ``means``, ``sigmas``: before anything was seen."""
    means, sigmas = list(means), list(sigmas)
    if verdict is not None:
        for i, (mean, sigma) in verdict.told().items():
            means[i], sigmas[i] = mean, sigma
    return means, sigmas


def worth_keeping(verdict: Verdict | None) -> KeptCalibration | None:
    """For the next flight; None while that is nothing."""
    if verdict is None or verdict.status is not CalibrationStatus.CALIBRATED:
        return None
    told = verdict.told()
    if not all(i in told for i in (Common.DELAY, *MOUNT)):
        return None
    x, y, z = verdict.mount_alone()
    return KeptCalibration(
        time_offset_s=told[Common.DELAY][0],
        time_offset_sigma_s=told[Common.DELAY][1],
        mount=(x[0], y[0], z[0]),
        mount_sigma=(x[1], y[1], z[1]),
    )
