"""The lens of a resized or a cropped image. Pixel (0, 0) is the centre of the top-left pixel, so centres move too."""

from __future__ import annotations

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.kannala_brandt import KannalaBrandt


def resized(lens: KannalaBrandt | BrownConrady, image_size: tuple[int, int]) -> KannalaBrandt | BrownConrady:
    """Of the whole image in other pixels."""
    su, sv = image_size[0] / lens.image_size[0], image_size[1] / lens.image_size[1]
    u0, v0 = lens.principal_point
    return _with(lens, (su, sv), (su * (u0 + 0.5) - 0.5, sv * (v0 + 0.5) - 0.5), image_size)


def cropped(
    lens: KannalaBrandt | BrownConrady, left_top: tuple[int, int], image_size: tuple[int, int]
) -> KannalaBrandt | BrownConrady:
    """Of the part of the image whose top-left pixel is ``left_top``. ValueError: it is not a part of the image."""
    (left, top), (width, height), (whole_width, whole_height) = left_top, image_size, lens.image_size
    if left < 0 or top < 0 or left + width > whole_width or top + height > whole_height:
        raise ValueError(f"{width} x {height} at ({left}, {top}) is no part of {whole_width} x {whole_height}")
    u0, v0 = lens.principal_point
    return _with(lens, (1.0, 1.0), (u0 - left, v0 - top), image_size)


def _with(
    lens: KannalaBrandt | BrownConrady,
    scale: tuple[float, float],
    principal_point: tuple[float, float],
    image_size: tuple[int, int],
) -> KannalaBrandt | BrownConrady:
    if isinstance(lens, KannalaBrandt):
        per_mm = (lens.pixels_per_mm[0] * scale[0], lens.pixels_per_mm[1] * scale[1])
        return KannalaBrandt(lens.k_mm, per_mm, principal_point, image_size, lens.max_angle, lens.skew)
    focal = (lens.focal[0] * scale[0], lens.focal[1] * scale[1])
    return BrownConrady(focal, principal_point, lens.distortion, image_size, lens.max_angle, lens.skew)
