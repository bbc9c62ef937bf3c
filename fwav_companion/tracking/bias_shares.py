"""Error budget of a target: the horizontal variance that it would lose if one cause of error were exactly known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol, runtime_checkable

from fwav_companion.tracking.filters.base import ReportedTarget
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.tracking.self_calibrated import CalibratedTargetState
from fwav_companion.types import Bias, ErrorPriors

BY_BIAS: Final[Mapping[Bias, str]] = {
    Bias.ROLL: "attitude",
    Bias.PITCH: "attitude",
    Bias.HEADING: "heading",
    Bias.MOUNT_X: "mount",
    Bias.MOUNT_Y: "mount",
    Bias.MOUNT_Z: "mount",
    Bias.TIME_OFFSET: "time",
    Bias.READOUT: "readout",
    Bias.HEIGHT: "height",
    Bias.POSITION_NORTH: "position",
    Bias.POSITION_EAST: "position",
    Bias.TERRAIN: "terrain",
    Bias.POSITION_DELAY: "position_delay",
    Bias.LEVER_X: "lever_arm",
    Bias.LEVER_Y: "lever_arm",
    Bias.LEVER_Z: "lever_arm",
}


@runtime_checkable
class SmoothedEstimate(Protocol):
    """A target by the smoother."""

    def shares_by_cause(self) -> dict[str, float]:
        """Horizontal variance that it would lose if one cause of error were exactly known, by cause, m^2."""


def bias_shares(target: ReportedTarget, priors: ErrorPriors) -> dict[str, float]:
    """Horizontal variance of a target by cause, m^2; empty for a filter without separate biases."""
    match target:
        case SmoothedEstimate():
            return target.shares_by_cause()
        case CalibratedTargetState(calibrator=calibrator, track=track):
            return _without_attitude(calibrator.bias_shares(track), priors)
        case StandingTargetState():
            return _summed(target.bias_shares())
        case _:
            return {}


def _summed(by_bias: Mapping[Bias, float]) -> dict[str, float]:
    shares: dict[str, float] = {}
    for bias, share in by_bias.items():
        shares[BY_BIAS[bias]] = shares.get(BY_BIAS[bias], 0.0) + share
    return shares


def _without_attitude(shares: dict[str, float], priors: ErrorPriors) -> dict[str, float]:
    """The shares with attitude split off mount: the joint estimate counts roll and pitch errors as mount errors."""
    attitude, mount = priors.sigma(Bias.PITCH) ** 2, priors.sigma(Bias.MOUNT_Y) ** 2
    if "mount" not in shares or attitude + mount == 0.0:
        return shares
    of_attitude = shares["mount"] * attitude / (attitude + mount)
    return {**shares, "mount": shares["mount"] - of_attitude, "attitude": of_attitude}
