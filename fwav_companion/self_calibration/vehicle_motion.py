"""Motion of the vehicle that sights close in time share: its slow rates, and its smoothed path."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import BootNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.position_path import PositionPath
from fwav_companion.self_calibration.rate_denoiser import SPAN_S, RateDenoiser, slow_rates
from fwav_companion.types import ErrorPriors, Unpaired, VehicleState


class VehicleMotion(msgspec.Struct, frozen=True, gc=False):
    """Motion of the vehicle at one instant, with the filters that estimate it."""

    slow: Vector3 = ZERO3
    """Mean angular rates around the instant, axes of the carrier, rad/s; zero where states around it are not known."""
    denoiser: RateDenoiser = RateDenoiser()
    path: PositionPath = PositionPath()

    def after(
        self, nominal: VehicleState, delay_s: float, state_at: StateAt | None, priors: ErrorPriors
    ) -> VehicleMotion:
        """The motion at a later capture with the delay ``delay_s``; ``nominal``: the vehicle state without delay."""
        slow, at = ZERO3, nominal
        if state_at is not None:
            half_ns, at_ns = ns_from_s(0.5 * SPAN_S), nominal.boot_ns - ns_from_s(delay_s)
            before, captured, later = (state_at(BootNs(at_ns + k * half_ns)) for k in (-1, 0, 1))
            if not (isinstance(before, Unpaired) or isinstance(later, Unpaired)):
                slow = slow_rates(before, later)
            if not isinstance(captured, Unpaired):
                at = captured
        path = self.path
        if at.position_ned is not None:
            path = path.after(s_from_ns(at.boot_ns), at.position_ned, at.velocity_ned or ZERO3, priors)
        return VehicleMotion(slow, self.denoiser.with_state(nominal, slow, priors.attitude_noise), path)
