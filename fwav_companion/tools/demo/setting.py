"""The flight of a demonstration: the configuration that the service gets, and the same numbers told to the mock. Pure.

The mock draws what is wrong with the vehicle from the very priors that the configuration states, by the seed; the
service is told none of it.
"""

from __future__ import annotations

from random import Random

import msgspec

from fwav_companion.config import Config

CONFIG_FILE, CAMERA_FILE, PIPE = "fwav-companion.toml", "camera.yaml", "frames.pipe"
SCENARIO = "demo"
READOUT_S = (0.015, 0.033)
"""Of a small sensor, by its data sheet: what the configuration knows."""
CAMERA_COMES_UP_S = 1.5
"""After the autopilot: nothing on a board is there at once."""
PRIORS = (
    "attitude_noise_deg", "attitude_bias_deg", "heading_bias_deg", "position_noise_m", "position_bias_m",
    "position_bias_time_s", "height_noise_m", "height_bias_m", "mount_bias_deg", "time_offset_sigma_s",
)  # fmt: skip
"""Of [uncertainty]; the mock knows them by the same names. Pixels have no prior: pictures are rendered."""


class Setting(msgspec.Struct, frozen=True):
    """One demonstration."""

    seed: int
    seconds: float
    scenario: str = SCENARIO

    @property
    def readout_s(self) -> float:
        """From the first row to the last, which the camera's maker tells."""
        return round(Random(self.seed).uniform(*READOUT_S), 4)  # noqa: S311  # a drawn flight, no secret

    def config_text(self, autopilot_port: int, ground_port: int) -> str:
        """The service's configuration, as a user would write one."""
        return f"""\
# The demonstration's own configuration. What is not here has its default: `fwav-companion init` shows them all.

[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:{autopilot_port}"
role = "autopilot"

[[link]]
name = "ground"
url = "udpout://127.0.0.1:{ground_port}"
role = "gcs"

[camera]
calibration = "{CAMERA_FILE}"
readout_s = {self.readout_s}             # a rolling shutter, by its data sheet

[detections]
url = ""                      # no other process sends pixels

[vision]
source = "{PIPE}"       # pictures with stamps, as a camera's driver delivers them
detector = "apriltag"

[record]
directory = "recording"
sync_s = 0.4

[status]
file = "status.json"
"""

    def mock_arguments(self, config: Config) -> list[str]:
        """For both processes of the mock."""
        told = {f"priors.{name}": getattr(config.uncertainty, name) for name in PRIORS}
        told |= {"camera.readout_s": self.readout_s, "camera.first_frame_s": CAMERA_COMES_UP_S}
        sets = [f"--set={name}={value!r}" for name, value in told.items()]
        return [f"--scenario={self.scenario}", f"--seed={self.seed}", f"--seconds={self.seconds}", *sets]
