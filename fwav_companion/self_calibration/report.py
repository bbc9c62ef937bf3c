"""What self-calibration tells, and what of it is kept for the next flight."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration.assessment import Assessment, CalibrationStatus
from fwav_companion.self_calibration.observability import MOUNT
from fwav_companion.self_calibration.pixel_measurement import SharedParameter
from fwav_companion.self_calibration.prior_inflation import PriorInflation


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
    denied: tuple[PriorInflation, ...] = ()
    """Priors of delay, mount and height that this flight denies: it was believed instead."""
    replaced: bool = False
    """What an earlier flight found was denied by this one, and dropped."""
    keep: KeptCalibration | None = None
    """What is worth keeping for the next flight; None while that is nothing."""


STEADY = 0.6
"""Of what the stamps of attitudes leave open, the share that is the same throughout a flight: a loop that sends at one
phase of itself makes all of it so, one that sends at any phase none, and flights do not tell which. A third of the
variance claims neither too much of the one nor twice too little of the other."""


def believed(
    verdict: Assessment | None, means: Sequence[float], sigmas: Sequence[float], stamp_sigma_s: float
) -> tuple[list[float], list[float]]:
    """Mean and one sigma of each of the common unknowns; ``means``, ``sigmas``: before anything was seen.

    ``stamp_sigma_s``: what the stamps of attitudes leave open. Attitudes that are all as late make targets no worse,
    but the camera seem early.
    """
    means, sigmas = list(means), list(sigmas)
    if verdict is not None:
        for i, (mean, sigma) in verdict.told.items():
            means[i], sigmas[i] = mean, hypot(sigma, STEADY * stamp_sigma_s) if i == SharedParameter.DELAY else sigma
    return means, sigmas


def worth_keeping(verdict: Assessment | None, stamp_sigma_s: float = 0.0) -> KeptCalibration | None:
    """For the next flight, whose attitudes may be stamped otherwise; None while that is nothing."""
    if verdict is None or verdict.status is not CalibrationStatus.CALIBRATED:
        return None
    told = verdict.told
    if not all(i in told for i in (SharedParameter.DELAY, *MOUNT)):
        return None
    x, y, z = verdict.mount_alone
    return KeptCalibration(
        time_offset_s=told[SharedParameter.DELAY][0],
        time_offset_sigma_s=hypot(told[SharedParameter.DELAY][1], STEADY * stamp_sigma_s),
        mount=(x[0], y[0], z[0]),
        mount_sigma=(x[1], y[1], z[1]),
    )
