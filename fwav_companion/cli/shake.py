"""``fwav-companion check --shake``: the camera's delay and mount, found by shaking the vehicle over a printed tag."""

from __future__ import annotations

import json
import sys
from math import degrees
from typing import TYPE_CHECKING

from fwav_companion.errors import ConfigError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from fwav_companion.config import Config
    from fwav_companion.tools.doctor.shake_session import ShakeResult
    from fwav_companion.tools.shake.instructions import Instruction

WAIT_S = 30.0
"""Seconds to wait for the vehicle and the tag, unless --seconds is given."""
EXIT_UNUSABLE = 1


def run_shake(config: Config, tag_size_m: float, wait_s: float, *, as_json: bool) -> int:
    """Instruct the user, record the session, print the estimate, and return the exit status."""
    require("check --shake", "numpy", "scipy", "cv2")
    from fwav_companion.config import load_signing_key
    from fwav_companion.service.configured_files import load_calibration
    from fwav_companion.tools.doctor.gathering import running_status
    from fwav_companion.tools.doctor.shake_session import shake

    _require_fixed_camera(config)
    calibration, key = load_calibration(config), load_signing_key(config)
    status = running_status(config)
    if status is not None:
        holder = f"a `run` (pid {status.typed.pid}) has the links and the camera"
        return _failed(f"{holder}: stop it (systemctl stop fwav-companion), then shake", as_json=as_json)
    with InstructionDisplay() as display:
        shown = shake(config, calibration, key, tag_size_m=tag_size_m, wait_s=wait_s, show=display.show)
    return _print_estimate(config, shown, as_json=as_json)


def _require_fixed_camera(config: Config) -> None:
    if config.camera.mount.gimbal_device_id:
        accepted = "accepted: a camera that is fixed to the body, gimbal_device_id = 0"
        raise ConfigError(f"{config.file}: [camera.mount] gimbal_device_id: a gimbal undoes the shaking; {accepted}")


def _print_estimate(config: Config, shown: ShakeResult, *, as_json: bool) -> int:
    if shown.shaking is None:
        return _failed(shown.advice.text, as_json=as_json)
    from fwav_companion.tools.shake.estimate import estimate
    from fwav_companion.tools.shake.shake_report import ShakeReport, is_usable

    result = estimate(shown.shaking)
    report = ShakeReport(config.file, shown.time_offset_s)
    for reason, count in shown.refused.items():
        print(f"{count} frames were not used: {reason.value}")
    for line in report.text(result):
        print(line)
    ok = is_usable(result)
    if as_json:
        print(json.dumps(report.json_object(result, ok=ok)))
    return 0 if ok else EXIT_UNUSABLE


def _failed(why: str, *, as_json: bool) -> int:
    print(f"nothing was found: {why}")
    if as_json:
        print(json.dumps({"ok": False, "why": why}))
    return EXIT_UNUSABLE


class InstructionDisplay:
    """Shows the instructions: in a progress bar on a terminal, elsewhere as a line at each change."""

    def __init__(self) -> None:
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._last = ""

    def __enter__(self) -> InstructionDisplay:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn
            from rich.table import Column

            words = Column(no_wrap=False)  # what is missing may need two lines
            columns = (TextColumn("[bold]{task.description}", table_column=words), BarColumn(20))
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task("", total=1.0)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, instruction: Instruction) -> None:
        """Display one instruction."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=instruction.share, description=_description(instruction))
        elif instruction.text != self._last:
            self._last = instruction.text
            print(("waiting: " if instruction.phase == "waiting" else "") + instruction.text, flush=True)


def _description(instruction: Instruction) -> str:
    """The bar's text: the instruction, the seconds that are left, and what has been collected."""
    left = "" if instruction.left_s is None else f" {instruction.left_s:3.0f} s"
    if not instruction.corners:
        return instruction.text + left
    roll, pitch = (degrees(angle) for angle in instruction.swung)
    collected = f"{instruction.corners} corners, roll ±{roll:.0f}°, pitch ±{pitch:.0f}°"
    return f"{instruction.text}{left}  [not bold]{collected}"
