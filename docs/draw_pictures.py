#!/usr/bin/env python3
"""Redraws docs/report.png and docs/self-calibration.png from the report of a demonstration, with headless Chromium.

``.venv/bin/fwav-companion demo && .venv/bin/python docs/draw_pictures.py demo-out/report.html``

It needs Chromium and Pillow, which the extra ``[demo]`` brings with matplotlib. docs/calibration.png is the figure that
``calibrate --report`` writes.
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


def draw(report: Path, folder: Path) -> None:
    """Write both pictures: the first screen, and the second flight."""
    html = report.read_text(encoding="utf-8")
    head, body = html.split("<main>", 1)
    first_screen = re.match(r'.*?<section class="two">.*?</section>', body, re.DOTALL)
    chapter = re.search(r'<div class="chapter">.*?</section></div>', body, re.DOTALL)
    if first_screen is None or chapter is None:
        sys.exit(f"{report}: not the report of a demonstration")
    for name, part in (("report.png", first_screen), ("self-calibration.png", chapter)):
        _screenshot(f"{head}<main>{part.group()}</main></body></html>", folder / name)


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
        sys.exit("usage: docs/draw_pictures.py demo-out/report.html")
    draw(Path(sys.argv[1]), Path(__file__).parent)
