"""One fix with its covariance, bias columns and budget, against the naive numpy version in ``naive_fix``.

``python -m tests.benchmarks.fix``
"""

from __future__ import annotations

from math import radians

import numpy as np

from fwav_companion.camera import KannalaBrandt
from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_euler
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import multiply
from fwav_companion.localization import HomeGround, Localizer
from fwav_companion.types import Bias, Detection, ErrorPriors, NoRay, Sighting, VehicleState
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.naive_fix import naive_fix

LENS = KannalaBrandt((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (640, 480))
DEFAULTS = ErrorPriors(
    pixel_noise_px=4.0,
    attitude_noise=radians(0.1),
    position_noise_m=0.1,
    height_noise_m=0.3,
    bias_sigmas=(radians(0.5),) * 2
    + (radians(2.0),)
    + (radians(1.0),) * 3
    + (0.01, 0.01, 0.5, 1.0, 1.0, 4.0, 0.05)
    + (0.03,) * 3
    + (0.0,),  # what is seen lies on the ground
    position_bias_time_s=60.0,
)
FIXES = 500


def a_sighting() -> Sighting:
    q = quaternion_from_euler(0.05, radians(37.0), 1.0)
    mount = body_from_camera_from_euler(0.0, radians(-90.0), 0.0)
    camera, u, v = (100.0, -50.0, -10.0), 136.4, 412.8
    state = VehicleState(BootNs(0), q, (0.4, 2.0, -0.2), 0.0, 0.004, camera, (6.0, 4.0, -0.5), 0.0, 10.0)
    ray = LENS.camera_ray_and_derivatives_from_pixel(u, v)
    assert not isinstance(ray, NoRay)
    now, world = HostNs(0), multiply(matrix_from_quaternion(q), mount)
    return Sighting(
        1, 0, now, now, Detection(u, v), ray, (4.0, 4.0), 0.86, 0.002, state, mount, world, camera, 10.0, False
    )


def naive_arguments(sighting: Sighting) -> tuple[object, ...]:
    """The sighting as arrays, prepared before the measurement."""
    state = sighting.state
    sigmas = {
        "u": sighting.pixel_sigma[0],
        "v": sighting.pixel_sigma[1],
        "attitude": DEFAULTS.attitude_noise,
        "height": DEFAULTS.height_noise_m,
        "time": sighting.time_noise_s,
        "place": DEFAULTS.position_noise_m,
    }
    return (
        np.array(sighting.ray.direction),
        np.column_stack([sighting.ray.d_du, sighting.ray.d_dv]),
        np.array(state.ned_from_body),
        np.array(sighting.body_from_camera),
        np.array(state.rates),
        np.array(state.velocity_ned),
        np.array(sighting.camera_ned),
        sighting.row_fraction,
        sigmas,
        np.array([0.0 if bias is Bias.TERRAIN else DEFAULTS.sigma(bias) for bias in Bias]),
    )


def one_fix() -> Figure:
    sighting = a_sighting()
    arguments = naive_arguments(sighting)
    localizer = Localizer(HomeGround(), DEFAULTS, min_height_m=0.5)

    def theirs() -> None:
        for _ in range(FIXES):
            naive_fix(*arguments)

    def ours() -> None:
        for _ in range(FIXES):
            localizer.locate(sighting)

    naive_s, ours_s = interleaved(theirs, ours)
    detail = f"naive {naive_s / FIXES * 1e6:.0f} us, ours {ours_s / FIXES * 1e6:.1f} us"
    return Figure("one fix with covariance", naive_s / ours_s, 15.0, True, detail)


def measure() -> list[Figure]:
    return [one_fix()]


if __name__ == "__main__":
    for figure in measure():
        print(figure)
