"""The files of the page: each that it loads is in the package and is served, also from an installed wheel."""

from __future__ import annotations

import posixpath
import re
from importlib.resources import files

import pytest

pytest.importorskip("aiohttp")

from fwav_companion.ground.server import PAGE, PAGE_FILES

REFERENCES = (r'(?:href|src)="page/([^"]+)"', r'from "\./([^"]+)"', r'import\("\./([^"]+)"\)')
"""In the page, and from one script to another."""


def loaded() -> set[str]:
    """Files that a browser loads, found by following every reference from the page on."""
    found: set[str] = set()
    waiting = ["index.html"]
    while waiting:
        name = waiting.pop()
        text = PAGE.joinpath(name).read_text(encoding="utf-8")
        for pattern in REFERENCES:
            names = {
                posixpath.normpath(posixpath.join(posixpath.dirname(name), each)) for each in re.findall(pattern, text)
            }
            waiting += [each for each in names - found if each.endswith(".js")]
            found |= names
    return found


def whole() -> None:
    """Fails where a file of the page, or a licence of what others wrote, is missing from this package."""
    page = loaded()
    assert {"app.js", "style.css", "vendor/leaflet.js", "vendor/leaflet.css", "vendor/mgrs.js"} <= page
    assert page <= PAGE_FILES
    for name in sorted(page | PAGE_FILES):
        assert PAGE.joinpath(name).is_file(), name
        assert PAGE.joinpath(name).read_bytes(), name
    for name in (each for each in page if each.startswith("vendor/")):
        licence = name.rpartition(".")[0] + ".LICENSE"
        assert "Copyright" in PAGE.joinpath(licence).read_text(encoding="utf-8"), licence


def test_every_file_that_the_page_loads_is_in_the_package_and_is_served():
    whole()


@pytest.mark.slow
def test_the_installed_package_has_them_too():
    """CI runs the slow tests on an installed wheel, where what the build left out is missing."""
    whole()
    assert (files("fwav_companion.ground") / "page" / "index.html").is_file()
