"""``fwav-companion check --click-delay``: the delay of the operator's video, by clicks on a blinking object."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from fwav_companion.errors import ConfigError

if TYPE_CHECKING:
    from fwav_companion.config import Config

WAIT_S = 60.0
"""Seconds for ten clicks, unless --seconds is given."""
EXIT_UNUSABLE = 1


def run_click_delay(config: Config, wait_s: float, *, as_json: bool) -> int:
    """Instruct the operator, print the delay and the lines to paste, and return the exit status."""
    from fwav_companion.config import load_signing_key
    from fwav_companion.service.configured_files import load_calibration
    from fwav_companion.tools.doctor.click_delay import NoClickDelay
    from fwav_companion.tools.doctor.click_delay_session import measure_click_delay
    from fwav_companion.tools.doctor.gathering import running_status

    if not any(link.role == "gcs" for link in config.link):
        raise ConfigError(
            f'{config.file}: [[link]]: no link has role = "gcs"; accepted: one of the operator\'s station'
        )
    status = running_status(config)
    if status is not None:
        holder = f"a `run` (pid {status.typed.pid}) has the links and the camera"
        return _failed(f"{holder}: stop it (systemctl stop fwav-companion), then click", as_json=as_json)
    shown = ShownSteps()
    result = measure_click_delay(
        config, load_calibration(config), load_signing_key(config), wait_s=wait_s, show=shown.show
    )
    if isinstance(result, NoClickDelay):
        return _failed(result.why, as_json=as_json)
    print(
        f"video delay {result.video_delay_s:.2f} s ± {2.0 * result.sigma_s:.2f} s (95 %) by {result.clicks} clicks; "
        f"configured: {config.publish.video_delay_s:g} s"
    )
    print(f"If your video is later than {result.period_s:.1f} s, blink more slowly. For the configuration:")
    print(f"\n[publish]\nvideo_delay_s = {result.video_delay_s:.2f}")
    if as_json:
        print(
            json.dumps(
                {
                    "ok": True,
                    "video_delay_s": round(result.video_delay_s, 4),
                    "sigma_s": round(result.sigma_s, 4),
                    "clicks": result.clicks,
                    "period_s": round(result.period_s, 4),
                }
            )
        )
    return 0


def _failed(why: str, *, as_json: bool) -> int:
    print(f"no delay was found: {why}")
    if as_json:
        print(json.dumps({"ok": False, "why": why}))
    return EXIT_UNUSABLE


class ShownSteps:
    """Prints each step once."""

    def __init__(self) -> None:
        self._last = ""

    def show(self, text: str) -> None:
        """Print a text that differs from the last one."""
        if text != self._last:
            self._last = text
            print(text, flush=True)
