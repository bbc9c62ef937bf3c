"""The handbook as a folder of files, on a laptop in the field: it loads nothing from outside, and its search works."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
MISSING = "no handbook: pip install '.[docs]'"
BUILD = (sys.executable, "-m", "mkdocs", "build", "--quiet", "--config-file", str(ROOT / "mkdocs.yml"), "--site-dir")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if importlib.util.find_spec("mkdocs") is None:
        if os.environ.get("HANDBOOK") == "required":
            pytest.fail(MISSING)
        pytest.skip(MISSING)
    folder = tmp_path_factory.mktemp("handbook") / "site"
    subprocess.run([*BUILD, str(folder)], check=True, cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    return folder


@pytest.mark.slow
def test_handbook_loads_nothing_from_outside(site: Path) -> None:
    for page in site.rglob("*.html"):
        loaded = re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(https?://[^"]+)"', page.read_text("utf-8"))
        assert [url for url in loaded if "fwav" not in url] == [], page


@pytest.mark.slow
def test_handbook_search_finds_a_page_in_a_folder_of_files(site: Path, browser: Any) -> None:
    browser.get((site / "start" / "install.html").as_uri())
    box = browser.find_element("css selector", "input.md-search__input")
    browser.execute_script("arguments[0].focus()", box)
    box.send_keys("landing target")
    deadline = time.monotonic() + 60.0
    while not (found := browser.find_elements("css selector", ".md-search-result__item")):
        assert time.monotonic() < deadline, "a hang"
        time.sleep(0.2)
    assert "Precision landing" in found[0].text
