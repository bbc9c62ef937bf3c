"""From what was seen and told while a vehicle was shaken to what is wrong with its camera, and what was not shown."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, hypot, radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.geometry.mounts import describe_mount
from fwav_companion.geometry.rotations import difference, quaternion_from_matrix, rotate
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tools.shake.first_look import FirstLook, first_look
from fwav_companion.tools.shake.fit import Fit, Start, fit
from fwav_companion.tools.shake.looks import AttitudeAt, Course, Looks, TagView, crossed, looks_of
from fwav_companion.tools.shake.names import NEAR, NOT_ROUND, OTHER_HAND, TURNED, Mistake, named
from fwav_companion.tools.shake.rates_lag import RatesLag, rates_lag
from fwav_companion.tools.shake.square_pose import pose_of_square
from fwav_companion.tools.shake.turns import Floats
from fwav_companion.types import AttitudeSample, Lens

LEAST_FRAMES: Final = 150
"""Five seconds of a common camera."""
LEAST_SIDE_PX: Final = 24.0
"""Three pixels a module of an AprilTag; the tilt of a smaller square drowns in the noise of its corners."""
MOST_PIXEL_SIGMA: Final = 2.0
"""Of a corner: what a detector that finds corners at all does not miss them by."""
STRANGERS: Final = 0.4
"""Likeness below which the turns seen and told do not belong together. Noise alone reaches 0.2."""
EVEN: Final = 0.98
"""Another delay that explains so large a share of what the best does is as good."""
LEAST_TURN: Final = radians(60.0)
"""Of the heading, for what is called a turn by 90 deg."""
LEAST_TURNED: Final = radians(0.5)
"""Between two frames a tenth of a second apart, RMS: slower than 5 deg/s is not shaking."""
MOST_DELAY_SIGMA_S: Final = 0.005
MOST_MOUNT_SIGMA: Final = radians(0.5)
"""What is known no better is not called known: the priors of [uncertainty] are 10 ms and 1 deg."""
MOUNT_FLOOR: Final = radians(0.03)
"""Of the corners' places on paper and through the lens, which no number of frames averages away."""


class Shaking(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that the estimate is made of."""

    views: Sequence[TagView]
    attitude_at: AttitudeAt
    samples: Sequence[AttitudeSample]
    """Attitudes as they were told, for the lag of their rates."""
    lens: Lens
    body_from_camera: Matrix3
    """As configured."""
    tag_size_m: float
    readout_s: float
    readout_sigma_s: float
    attitude_noise: float
    """[uncertainty] attitude_noise_deg, radians."""
    clock_sigma_s: float
    """Of the autopilot's clock against the host's, through the whole of it."""
    stamp_sigma_s: float
    """Of how late attitudes are stamped."""


class Known(msgspec.Struct, frozen=True):
    """A number with its sigma."""

    value: float
    sigma: float


class Shaken(msgspec.Struct, frozen=True, kw_only=True):
    """What came of it."""

    frames: int = 0
    """In which the tag was seen whole."""
    side_px: float = 0.0
    """Its shortest side in the image, the median."""
    held_m: float = 0.0
    """From the camera to the tag, the median, by the tag's size."""
    turned: float = 0.0
    """How far apart the headings were, radians."""
    swung: Vector3 = (0.0, 0.0, 0.0)
    """How fast the body turned about each of its axes, RMS, rad/s."""
    likeness: float = 0.0
    """Of what was seen to what was told, 0 to 1."""
    pixel_sigma: float | None = None
    """Of a corner, an axis."""
    mistakes: tuple[Mistake, ...] = ()
    not_shown: tuple[str, ...] = ()
    """What could not be found, and why."""
    delay: Known | None = None
    """What comes on top of the configured delay, seconds."""
    mount: tuple[Known, Known, Known] | None = None
    """The correction: a rotation vector in body axes, radians."""
    body_from_camera: Matrix3 | None = None
    """The corrected mount."""
    rates: RatesLag | None = None


def estimate(shaking: Shaking) -> Shaken:
    """Everything that the shaking shows."""
    rates = rates_lag(shaking.samples)
    shaken = Shaken(rates=rates, mistakes=_of_rates(rates))
    if rates is None:
        shaken = _without(shaken, "lag of the rates: none are told, or too little was turned")
    looks = looks_of(shaking.views, shaking.lens)
    shaken = msgspec.structs.replace(shaken, frames=len(looks))
    if len(looks) < LEAST_FRAMES:
        return _too_few(shaken, shaking.views)
    course = Course(shaking.attitude_at, shaking.views[0].boot_ns)
    shaken = msgspec.structs.replace(
        shaken, side_px=float(np.median(looks.sides_px)), turned=_turned(looks, course), swung=_swung(looks, course)
    )
    if shaken.side_px < LEAST_SIDE_PX:
        told = f"camera: the tag's side is {shaken.side_px:.0f} pixels, at least {LEAST_SIDE_PX:.0f} it takes"
        return _without(shaken, f"{told}: nearer, or a larger print")
    return _seen(shaking, looks, course, shaken)


def _too_few(shaken: Shaken, views: Sequence[TagView]) -> Shaken:
    if crossed(views) > len(views) / 2:
        return _without(_blamed(shaken, NOT_ROUND), "camera: its corners lie crosswise")
    return _without(
        shaken, f"camera: the tag was seen whole in {shaken.frames} frames, at least {LEAST_FRAMES} it takes"
    )


def _seen(shaking: Shaking, looks: Looks, course: Course, shaken: Shaken) -> Shaken:
    times_s = looks.times_s + shaking.readout_s * looks.rows.mean(axis=1)
    camera_from_tag, middles, _ = pose_of_square(looks.at_once(shaking.readout_s), looks.pixel_from_ray)
    held_m = shaking.tag_size_m * float(np.median(np.linalg.norm(middles, axis=1)))
    shaken = msgspec.structs.replace(shaken, held_m=held_m)
    look = first_look(times_s, camera_from_tag, course)
    if look is None:
        return _without(shaken, "camera: attitudes are missing for most of the frames")
    shaken = msgspec.structs.replace(shaken, likeness=look.likeness)
    refusal = _refusal(look)
    if refusal:
        return _without(shaken, refusal)
    configured = np.array(shaking.body_from_camera).T
    mistake = named(look, configured, backward=looks.backward)
    if mistake is None and _looks_away(look, looks, camera_from_tag, course):
        mistake = OTHER_HAND
    if mistake is not None:
        shaken = _blamed(shaken, mistake)
    if mistake is not None and not mistake.mount_rights_it:
        return _without(shaken, "delay and mount: not before the signs are right")
    start = Start(
        delay_s=look.delay_s,
        camera_from_body=look.camera_from_body,
        readout_s=shaking.readout_s,
        readout_sigma_s=shaking.readout_sigma_s,
        attitude_noise=shaking.attitude_noise,
    )
    found = fit(looks, course, start, shaking.tag_size_m)
    if found is None or found.pixel_sigma > MOST_PIXEL_SIGMA:
        return _without(shaken, "delay and mount: the corners do not agree with the attitudes")
    return _judged(shaking, found, shaken)


def _looks_away(look: FirstLook, looks: Looks, camera_from_tag: Floats, course: Course) -> bool:
    """Whether the tag would face the ground and not the sky, by such a mount: no mount sees that."""
    ned_from_body, known = course.at(looks.times_s - look.delay_s)
    down_by_attitude = ned_from_body[known, 2, :] @ look.camera_from_body.T
    return bool((down_by_attitude * camera_from_tag[known, :, 2]).sum(axis=1).mean() < 0.0)


def _refusal(look: FirstLook) -> str:
    """Why the turns tell nothing."""
    if np.sort(look.turned)[1] < LEAST_TURNED:
        return "delay and mount: too little shaking about two axes"
    if look.likeness < STRANGERS:
        return "delay and mount: what the camera sees turns otherwise than the autopilot says: is it on this vehicle?"
    if look.rival > EVEN * look.likeness:
        return "delay and mount: shaken too evenly, a beat later fits as well: shake without a rhythm"
    return ""


def _judged(shaking: Shaking, found: Fit, shaken: Shaken) -> Shaken:
    """What is known well enough to be told."""
    shaken = msgspec.structs.replace(shaken, frames=found.frames, pixel_sigma=found.pixel_sigma)
    delay_sigma_s = hypot(float(found.sigmas[0]), shaking.clock_sigma_s, shaking.stamp_sigma_s)
    if delay_sigma_s <= MOST_DELAY_SIGMA_S:
        shaken = msgspec.structs.replace(shaken, delay=Known(found.delay_s, delay_sigma_s))
    else:
        shaken = _without(shaken, f"delay: known to {1e3 * delay_sigma_s:.0f} ms only: shake faster")
    sigmas = [hypot(float(sigma), MOUNT_FLOOR) for sigma in found.sigmas[1:4]]
    reasons = _mount_not_shown(sigmas, shaken.turned)
    if reasons:
        return _without(shaken, *reasons)
    mount = _matrix3(found.body_from_camera)
    correction = _correction(mount, shaking.body_from_camera)
    known = tuple(Known(value, sigma) for value, sigma in zip(correction, sigmas, strict=True))
    shaken = msgspec.structs.replace(shaken, mount=known, body_from_camera=mount)
    if not any(mistake.mount_rights_it for mistake in shaken.mistakes) and hypot(*correction) > NEAR:
        told = f"mount {degrees(hypot(*correction)):.0f} deg from the configured one"
        shaken = _blamed(shaken, Mistake(f"{told}: {describe_mount(mount)}", TURNED, True))
    return shaken


def _mount_not_shown(sigmas: Sequence[float], turned: float) -> list[str]:
    if turned < LEAST_TURN:
        seen = f"never turned by 90 deg, {degrees(turned):.0f} deg were seen"
        return [f"mount: {seen}, and so it cannot be told from the slope of the ground"]
    return [
        f"mount {axis}: known to {degrees(sigma):.1f} deg only: shake wider, with more light, over a larger print"
        for axis, sigma in zip(("roll", "pitch", "yaw"), sigmas, strict=True)
        if sigma > MOST_MOUNT_SIGMA
    ]


def _turned(looks: Looks, course: Course) -> float:
    """Between the headings of the tenth and of the ninetieth frame in a hundred."""
    ned_from_body, known = course.at(looks.times_s)
    headings = np.unwrap(np.arctan2(ned_from_body[known, 1, 0], ned_from_body[known, 0, 0]))
    if not len(headings):
        return 0.0
    low, high = np.percentile(headings, [10.0, 90.0])
    return float(high - low)


def _swung(looks: Looks, course: Course) -> Vector3:
    rates, known = course.rates(looks.times_s)
    if not known.any():
        return (0.0, 0.0, 0.0)
    roll, pitch, yaw = np.sqrt((rates[known] ** 2).mean(axis=0)).tolist()
    return (roll, pitch, yaw)


def _of_rates(rates: RatesLag | None) -> tuple[Mistake, ...]:
    if rates is None:
        return ()
    do = "the autopilot's rates contradict its own attitude: whoever passes them on has a sign wrong"
    return tuple(Mistake(f"{axis} rate reversed", do, mount_rights_it=False) for axis in rates.reversed)


def _correction(mount: Matrix3, configured: Matrix3) -> Vector3:
    """Body axes: mount = Exp(correction) configured."""
    there, here = quaternion_from_matrix(mount), quaternion_from_matrix(configured)
    return rotate(here, difference(there, here))


def _matrix3(m: Floats) -> Matrix3:
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in m)
    return (a, b, c)


def _without(shaken: Shaken, *reasons: str) -> Shaken:
    return msgspec.structs.replace(shaken, not_shown=(*shaken.not_shown, *reasons))


def _blamed(shaken: Shaken, mistake: Mistake) -> Shaken:
    return msgspec.structs.replace(shaken, mistakes=(*shaken.mistakes, mistake))
