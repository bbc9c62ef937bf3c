"""SHELL: one line for the user where a library is missing, with the command that installs it.

`pip install .` brings every library but those of the extras. On 32-bit Arm it leaves out those without a wheel there.
"""

from __future__ import annotations

from importlib.util import find_spec

from fwav_companion.errors import UserError

EXTRAS = {
    "aiohttp": "ground",
    "av": "stream",
    "cloudpickle": "study",
    "cryptography": "tak",
    "dask": "study",
    "distributed": "study",
    "foxglove": "foxglove",
    "matplotlib": "demo",
    "mcap": "mcap",
    "onnxruntime": "onnx",
    "PIL": "photos",
    "pyarrow": "study",
    "pyulog": "ulog",
    "rasterio": "terrain",
    "zenoh": "fleet",
}
"""The extra of this project that installs a library, by the library's import name."""
WITHOUT_WHEEL = frozenset({"cv2", "numpy", "scipy"})
"""Import names of the libraries that have no wheel for 32-bit Arm; Debian 12's packages of them are too old."""


def require(purpose: str, *modules: str) -> None:
    """Check that these modules are installed; UserError with the command that installs those that are not."""
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise UserError(f"{purpose}: {advice(*missing)}")


def is_installed(module: str) -> bool:
    """Whether a library that an installation may lack is there."""
    return find_spec(module) is not None


def is_known(module: str) -> bool:
    """Whether the module belongs to a library that an installation may lack."""
    return module.partition(".")[0] in WITHOUT_WHEEL.union(EXTRAS)


def advice(*missing: str) -> str:
    """One line: the libraries of these modules, and the commands that install them."""
    names = sorted({module.partition(".")[0] for module in missing})
    verb = "is" if len(names) == 1 else "are"
    extras = sorted({EXTRAS[name] for name in names if name in EXTRAS})
    wanted = f"'.[{','.join(extras)}]'" if extras else "."
    line = f"{' and '.join(names)} {verb} not installed; run pip install {wanted} in the project's folder"
    if WITHOUT_WHEEL.intersection(names):
        line += " (32-bit systems cannot have it: they relay, and take detections by UDP)"
    return line
