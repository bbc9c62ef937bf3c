#!/usr/bin/env python3
"""Redraws docs/report.png and docs/self-calibration.png from the report of a demonstration, or docs/study.png.

``.venv/bin/fwav-companion demo && .venv/bin/python docs/draw_pictures.py demo-out/report.html``, or the same with the
report of ``study --vary flight.height_m=5:40``, in headless Chromium.

It needs Chromium and Pillow, which the extra ``[demo]`` brings with matplotlib.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from PIL import Image, ImageChops

WIDTH, TALLEST = 1140, 4000
"""Of the browser window, pixels."""
MARGIN = 24
"""Above the first element and below the last one, pixels."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


DEMO = {
    "report.png": r'<main>(.*?<section class="two">.*?</section>)',
    "self-calibration.png": r'(<div class="chapter">.*?</section></div>)',
}
STUDY = {"study.png": r"<main>(.*?What to change first.*?</section>)"}
"""Part of the page that each picture shows."""


def draw(report: Path, folder: Path) -> None:
    """Write the pictures: of a demonstration the first screen and the second flight, of a study the first screen."""
    html = report.read_text(encoding="utf-8")
    head, _ = html.split("<main>", 1)
    for name, pattern in (STUDY if "fwav-companion study" in html else DEMO).items():
        part = re.search(pattern, html, re.DOTALL)
        if part is None:
            sys.exit(f"{report}: not the report of a demonstration or a study")
        _screenshot(f"{head}<main>{part[1]}</main></body></html>", folder / name)


def _screenshot(html: str, path: Path) -> None:
    """Render the page, and crop the empty space above and below."""
    browser = next(filter(None, map(which, BROWSERS)), None)
    if browser is None:
        sys.exit(f"no browser found: install one of {', '.join(BROWSERS)}")
    with TemporaryDirectory() as folder:
        page, picture = Path(folder, "page.html"), Path(folder, "page.png")
        page.write_text(html, encoding="utf-8")
        options = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            f"--user-data-dir={folder}/profile",
        ]
        window = [f"--window-size={WIDTH},{TALLEST}", f"--screenshot={picture}", page.as_uri()]
        subprocess.run([browser, *options, *window], check=True, capture_output=True, timeout=120)  # noqa: S603
        drawn = Image.open(picture).convert("RGB")
    background = Image.new("RGB", drawn.size, drawn.getpixel((0, TALLEST - 1)))
    box = ImageChops.difference(drawn, background).getbbox() or (0, 0, WIDTH, TALLEST)
    drawn.crop((0, max(0, box[1] - MARGIN), WIDTH, min(TALLEST, box[3] + MARGIN))).save(path, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: docs/draw_pictures.py REPORT.html")
    draw(Path(sys.argv[1]), Path(__file__).parent)
