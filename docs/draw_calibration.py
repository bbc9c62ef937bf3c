#!/usr/bin/env python3
"""Redraws docs/calibration.png: the figure that ``calibrate --report`` writes, of twenty drawn pictures of a board.

``.venv/bin/python docs/draw_calibration.py`` from a checkout, in an environment with the extra ``[test]``. The pictures
are those of the tests of `calibrate`: a ChArUco board as a lens of 200 degrees sees it, drawn by mathematics of their
own. Two of them are spoiled, so that the figure shows pictures that are not used.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / "tests" / "tools" / "calibrate"))

from drawn_boards import WIDE, charuco_sheet, picture, poses, printed_grey  # noqa: E402  # found by the line above

PICTURES = 20
SPOILED = (6, 15)
REACH = 1.35
"""Largest angle of a board's middle from the optical axis, radians."""
BOARD = "charuco:7x5:30mm:22mm:DICT_4X4_50"


def main() -> None:
    """Draw the pictures, fit the lens, keep the figure."""
    rng = np.random.default_rng(1)
    sheet = charuco_sheet()
    width_m = 0.03 * sheet.shape[1] / 60
    with TemporaryDirectory() as folder:
        for number, pose in enumerate(poses(rng, PICTURES, width_m, reach=REACH, share=1.5)):
            drawn = picture(WIDE, pose, printed_grey(sheet, width_m), rng)
            if number in SPOILED:
                drawn = cv2.GaussianBlur(drawn, (0, 0), 12.0)
            cv2.imwrite(f"{folder}/{number:02d}.png", drawn)
        words = [sys.executable, "-m", "fwav_companion", "calibrate", folder, "--board", BOARD]
        subprocess.run([*words, f"--out={folder}/camera.yaml", f"--report={folder}/report"], check=True)  # noqa: S603
        shutil.copy(f"{folder}/report/calibration.png", DOCS / "calibration.png")


if __name__ == "__main__":
    main()
