"""SHELL: the result of self-calibration, kept for the next flight of the same camera on the same mount."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from math import hypot

import msgspec

from fwav_companion.config import Config
from fwav_companion.errors import ImplausibleStateError
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.service.kept_state import read_state
from fwav_companion.service.latest_file import LatestFile, state_path
from fwav_companion.types import Bias, ErrorPriors

NAME = "calibration.json"
EVERY_TICKS = 60
"""Interval of writes, in ticks of a second: the result hardly changes. It is also written at the end."""


ADDED_TO_MOUNT = {"gimbal_yaw_bias_deg": 3.0, "gimbal_delay_s": 0.0}
"""Keys that an older configuration does not have, and their defaults: they do not make it another camera."""


class _Kept(msgspec.Struct):
    """The file. It expires when the camera file, the mount or the configured offset changes."""

    camera: str
    calibration: KeptCalibration


class CalibrationStore:
    """Reads the file at the start and writes it once a minute; does neither without a state directory."""

    def __init__(self, config: Config, on_failure: Callable[[str], None]) -> None:
        """``on_failure`` gets one line on a file that cannot be used or written."""
        directory = config.state.directory
        wanted = config.tracking.self_calibration and bool(config.camera.calibration)
        self._camera = _fingerprint(config) if wanted else ""
        self._path = state_path(config.resolve(directory) if directory else None, NAME) if wanted else None
        self._priors = config.priors
        self._on_failure = on_failure
        self._file = None if self._path is None else LatestFile([self._path], on_failure, outlives_us=True)
        self._ticks = 0
        self._latest: KeptCalibration | None = None

    def kept(self) -> KeptCalibration | None:
        """Calibration of an earlier flight; None without one, or if it cannot be used or belongs to another camera."""
        if self._path is None:
            return None
        kept = read_state(self._path, self._decoded, self._on_failure)
        return kept.calibration if kept is not None and kept.camera == self._camera else None

    def _decoded(self, content: bytes) -> _Kept:
        """The content of the file. ImplausibleStateError if this camera cannot have such a calibration."""
        kept = msgspec.json.decode(content, type=_Kept)
        if kept.camera == self._camera:
            fault = kept.calibration.implausible(self._priors.sigma(Bias.TIME_OFFSET), _mount_sigma(self._priors))
            if fault:
                raise ImplausibleStateError(fault)
        return kept

    def start(self) -> None:
        """Start the writer."""
        if self._file is not None:
            self._file.start()

    def tick(self, found: KeptCalibration | None) -> None:
        """Update the result, once a second."""
        self._latest = found or self._latest
        self._ticks += 1
        if self._ticks % EVERY_TICKS == 0:
            self._write()

    def close(self, timeout_s: float) -> None:
        """Write the newest result and stop the writer."""
        self._write()
        if self._file is not None:
            self._file.close(timeout_s)

    def _write(self) -> None:
        if self._file is not None and self._latest is not None:
            self._file.write(msgspec.json.encode(_Kept(self._camera, self._latest)))


def _mount_sigma(priors: ErrorPriors) -> Vector3:
    """One sigma of what a flight finds as the mount, rad: constant errors of the attitude are part of it."""
    return (
        hypot(priors.sigma(Bias.MOUNT_X), priors.sigma(Bias.ROLL)),
        hypot(priors.sigma(Bias.MOUNT_Y), priors.sigma(Bias.PITCH)),
        hypot(priors.sigma(Bias.MOUNT_Z), priors.sigma(Bias.HEADING)),
    )


def _fingerprint(config: Config) -> str:
    """Hash of the configured camera: its calibration file, mount, delay and readout."""
    camera = msgspec.to_builtins(config.camera)
    for key, default in ADDED_TO_MOUNT.items():
        if camera["mount"][key] == default:
            del camera["mount"][key]
    described = msgspec.json.encode(camera) + config.calibration_path.read_bytes()
    return hashlib.sha256(described).hexdigest()
