"""Refuses numbers that no lens has: mostly those of one model under the name of another."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan, degrees, hypot, pi
from typing import Final

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.fields import Fields
from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.camera.sphere_lens import SphereLens
from fwav_companion.types import NoRay

LARGEST_TANGENTIAL: Final = 0.02
"""Largest tangential coefficient of a lens that is mounted straight: it is the tilt of sensor against lens, radians."""
WIDEST_PINHOLE_DEG, NARROWEST_DEG = 150.0, 0.5
"""Limits of the horizontal field of view of a rectilinear lens with distortion; a lens of 0.5 deg is a telescope."""
EVERYWHERE: Final = 16
"""Pixels of each side of the image at which the radial function is tested."""
INSCRIBED: Final = 0.9
"""Share of half of the shorter side that every fisheye covers: beyond, a circular image may end before the sensor."""


def require_pinhole_terms(fields: Fields, key: str, model_key: str, d: Sequence[float]) -> None:
    """Refuse tangential terms of plumb_bob or radtan that no lens has; four numbers of a fisheye have such a third."""
    p1, p2 = d[2:4]
    if max(abs(p1), abs(p2)) <= LARGEST_TANGENTIAL:
        return
    fisheye = len(d) == 4 or d[4] == 0.0
    says = f"tangential terms (the third and fourth) of at most {LARGEST_TANGENTIAL:g}" + (
        f"; four numbers of a fisheye? then write {model_key}: equidistant" if fisheye else ""
    )
    raise fields.refusal(key, says)


def require_monotonic(fields: Fields, key: str, lens: BrownConrady | KannalaBrandt | SphereLens) -> None:
    """Refuse a radial function that turns back inside the image: two rays of one pixel."""
    width, height = lens.image_size
    if isinstance(lens, BrownConrady):
        steps = [i / EVERYWHERE for i in range(EVERYWHERE + 1)]
        border = [(s * width - 0.5, edge) for s in steps for edge in (-0.5, height - 0.5)]
        border += [(edge, s * height - 0.5) for s in steps for edge in (-0.5, width - 0.5)]
        bad = any(isinstance(lens.camera_ray_from_pixel(*pixel), NoRay) for pixel in border)
        accepted = (
            "coefficients whose radial function rises to the corners of the image; calibrate with the board there"
        )
    else:
        u0, v0 = lens.principal_point
        reach = INSCRIBED * 0.5 * min(width, height)
        bad = any(
            isinstance(lens.camera_ray_from_pixel(u0 + du * reach, v0 + dv * reach), NoRay)
            for du, dv in ((1, 0), (-1, 0), (0, 1), (0, -1))
            if -0.5 <= u0 + du * reach <= width - 0.5 and -0.5 <= v0 + dv * reach <= height - 0.5
        )
        accepted = "coefficients whose radial function rises inside the image: it turns back; is it the file's model?"
    if bad:
        raise fields.refusal(key, accepted)


def require_field_of_view(fields: Fields, key: str, lens: BrownConrady | KannalaBrandt) -> None:
    """Refuse focal lengths that contradict the image's size: they are those of another size, or in other units."""
    width, height = lens.image_size
    if isinstance(lens, BrownConrady):
        across = degrees(2.0 * atan(0.5 * width / lens.focal[0]))
        widest = WIDEST_PINHOLE_DEG
    else:
        focal = (lens.k_mm[0] * lens.pixels_per_mm[0], lens.k_mm[0] * lens.pixels_per_mm[1])
        across = degrees(width / focal[0])
        widest = degrees(2.0 * pi) * hypot(width, height) / width  # a circle of 360 deg in the corners
    if not NARROWEST_DEG <= across <= widest:
        raise fields.refusal(
            key,
            f"focal lengths in pixels of this image of {width} x {height}: with these its field of view would be "
            f"{across:.3g} deg",
        )
