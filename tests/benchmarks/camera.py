"""The daemon with a camera of its own: memory and CPU of all its processes, with AprilTags at 640x480.

A folder replaces the camera: a picture is added thirty times a second. The mock flies as a separate process. ``python
-m tests.benchmarks.camera``
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from tests.benchmarks.daemon import child, free_port
from tests.benchmarks.figure import Figure
from tests.benchmarks.startup import relay_configuration

SIZE = (640, 480)
TAGS = 4
PICTURES = 30
HZ = 30.0
SETTLING_S, MEASURED_S = 5.0, 10.0
KIB_A_MIB = 1024

CONFIGURATION = """
[camera]
calibration = "camera.yaml"
[vision]
source = "pictures"
detector = "apriltag"
"""


def picture(number: int) -> np.ndarray:
    """A picture with some tags on a noisy floor; their places differ from picture to picture."""
    rng = np.random.default_rng(number)
    pixels = rng.integers(90, 150, (SIZE[1], SIZE[0]), dtype=np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for k in range(TAGS):
        left, top = 40 + 150 * k + number % 20, 60 + 80 * k + number % 15
        pixels[top - 10 : top + 90, left - 10 : left + 90] = 255
        pixels[top : top + 80, left : left + 80] = cv2.aruco.generateImageMarker(dictionary, k, 80)
    return cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR)


def fill(folder: Path, seconds: float) -> None:
    """Print the name of a new picture in each frame interval."""
    until = time.monotonic() + seconds
    number = 0
    with (folder / "stamps.jsonl").open("a") as lines:
        while time.monotonic() < until:
            reported = {"file": f"{number % PICTURES}.png", "time_monotonic": time.monotonic() - 0.01, "frame": number}
            lines.write(json.dumps(reported) + "\n")
            lines.flush()
            number += 1
            time.sleep(1.0 / HZ)


def family(pid: int) -> list[int]:
    """The process and its children."""
    return [pid, *map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())]


def memory_mib(pid: int, kind: str) -> float:
    """Memory of a process: Pss, which counts shared pages by their share, or Rss, which counts them in full."""
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith(f"{kind}:"):
            return int(line.split()[1]) / KIB_A_MIB
    raise AssertionError(f"no {kind} of {pid}")


def measure() -> list[Figure]:
    """The maxima over all processes, sampled once a second."""
    port = free_port()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        subprocess.run([sys.executable, "-m", "fwav_companion", "init"], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL)  # fmt: skip
        (folder / "flight.toml").write_text(relay_configuration(free_port(), port) + CONFIGURATION)
        pictures = folder / "pictures"
        pictures.mkdir()
        (pictures / "stamps.jsonl").touch()
        for number in range(PICTURES):
            cv2.imwrite(str(pictures / f"{number}.png"), picture(number))
        daemon = stack.enter_context(child("-m", "fwav_companion", "run", "--config", "flight.toml", folder=folder))
        mock = ("-m", "sitl_mock", "--connect", f"udpout:127.0.0.1:{port}", "--detections", "", "--seconds", "600")
        stack.enter_context(child(*mock, folder=folder))
        fill(pictures, SETTLING_S)
        taken: list[tuple[float, float, list[str]]] = []
        for _ in range(round(MEASURED_S)):
            fill(pictures, 1.0)
            each = [memory_mib(pid, "Pss") for pid in family(daemon.pid)]
            whole = sum(memory_mib(pid, "Rss") for pid in family(daemon.pid))
            taken.append((sum(each), whole, [f"{mib:.0f}" for mib in each]))
        status = json.loads((folder / "status.json").read_text())
    if status["detections"] < TAGS * HZ or len(taken[-1][2]) < 2:
        raise AssertionError(f"tags were not seen: {status['detections']} in {status['frames']} pictures")
    pss_mib, rss_mib, each_mib = max(taken)
    reported = (
        f"{' + '.join(each_mib)} MiB; {rss_mib:.0f} if nothing were shared; {status['frames']} pictures, {TAGS} tags"
    )
    return [Figure("daemon with a camera and AprilTags: PSS of all processes, MiB", pss_mib, 160.0, False, reported)]


if __name__ == "__main__":
    print(*measure(), sep="\n")
