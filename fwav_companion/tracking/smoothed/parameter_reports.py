"""The smoother's shared parameters in the units, signs and words of the configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.answers import CALIBRATED_SHARE, ParameterStatus
from fwav_companion.estimation.errors import MOUNT, PITCH, ROLL, SharedPriors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.types.flight_status import ParameterReport


class ReportedParameter(NamedTuple):
    """How a shared parameter is reported."""

    name: str
    factor: float
    """To the unit of the name; -1 turns an error into a correction."""
    key: str
    """The key of the configuration that states its prior."""


_DEGREES = degrees(1.0)
REPORTED = (
    ReportedParameter("time_offset_s", 1.0, "[uncertainty] time_offset_sigma_s"),
    ReportedParameter("mount_x_deg", -_DEGREES, "[uncertainty] mount_bias_deg"),
    ReportedParameter("mount_y_deg", -_DEGREES, "[uncertainty] mount_bias_deg"),
    ReportedParameter("mount_z_deg", -_DEGREES, "[uncertainty] mount_bias_deg"),
    ReportedParameter("heading_deg", _DEGREES, "[uncertainty] heading_bias_deg"),
    ReportedParameter("roll_deg", _DEGREES, "[uncertainty] attitude_bias_deg"),
    ReportedParameter("pitch_deg", _DEGREES, "[uncertainty] attitude_bias_deg"),
    ReportedParameter("height_m", 1.0, "[uncertainty] height_bias_m"),
    ReportedParameter("position_delay_s", 1.0, "[uncertainty] position_delay_sigma_s"),
    ReportedParameter("lever_x_m", 1.0, "[uncertainty] lever_arm_sigma_m"),
    ReportedParameter("lever_y_m", 1.0, "[uncertainty] lever_arm_sigma_m"),
    ReportedParameter("lever_z_m", 1.0, "[uncertainty] lever_arm_sigma_m"),
    ReportedParameter("readout_s", 1.0, "[camera] readout_s"),
    ReportedParameter("gimbal_yaw_deg", _DEGREES, "[camera.mount] gimbal_yaw_bias_deg"),
    ReportedParameter("gimbal_delay_s", 1.0, "[camera.mount] gimbal_delay_s"),
)
"""By the index of the smoother's shared parameters."""


def camera_statuses(estimator: Estimator, configured: SharedPriors | None = None) -> list[ParameterStatus]:
    """Status of every shared parameter; about x and y what turns the camera in all, mount and attitude together.

    ``configured``: the priors without a calibration of an earlier flight. What that one knows and this one has not
    contradicted is calibrated: the flight need not show it again.
    """
    statuses = list(estimator.self_calibration())
    statuses[MOUNT.start : MOUNT.start + 2] = estimator.camera_tilt()
    if configured is None or estimator.model.consider:
        return statuses
    sigma = configured.sigma.copy()
    sigma[MOUNT.start : MOUNT.start + 2] = np.hypot(sigma[MOUNT.start : MOUNT.start + 2], sigma[[ROLL, PITCH]])
    return [
        replace(status, status="calibrated", reason=None)
        if status.status == "waiting" and status.sigma < CALIBRATED_SHARE * sigma[index]
        else status
        for index, status in enumerate(statuses)
    ]


def parameter_reports(statuses: Sequence[ParameterStatus]) -> tuple[ParameterReport, ...]:
    """The report of each parameter."""
    return tuple(_report(status, REPORTED[index]) for index, status in enumerate(statuses))


def _report(status: ParameterStatus, reported: ReportedParameter) -> ParameterReport:
    scale = abs(reported.factor)
    reason = status.reason
    if status.status == "contradicts":
        reason = f"{reason} ({reported.key} = {scale * status.prior_sigma:.3g})"
    return ParameterReport(
        name=reported.name,
        status=status.status,
        reason=reason,
        estimate=reported.factor * status.estimate,
        sigma=scale * status.sigma,
        prior_sigma=scale * status.prior_sigma,
    )
