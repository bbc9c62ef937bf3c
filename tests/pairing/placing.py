"""A vehicle, a lens and frames with plain defaults: a test states only what it is about."""

from math import hypot, pi
from typing import Any

import msgspec

from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.pairing import Pairer
from fwav_companion.types import (
    Detection,
    Frame,
    NoRay,
    Ray,
    Reason,
    StampClock,
    Unpaired,
    VehicleState,
)

MS = 1_000_000
HOST_FROM_BOOT_NS = 7_000_000_000_000
DOWN = body_from_camera_from_euler(0.0, -pi / 2, 0.0)


class Pinhole:
    """300 px focal length, 640x480, valid to 0.6 rad."""

    image_size = (640, 480)
    max_angle = 0.6

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        ray = self.camera_ray_and_derivatives_from_pixel(u, v)
        return ray if isinstance(ray, NoRay) else ray.direction

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        x, y = (u - 320.0) / 300.0, (v - 240.0) / 300.0
        if hypot(x, y) > 0.684:  # tan 0.6
            return NoRay()
        n = hypot(x, y, 1.0)
        return Ray((x / n, y / n, 1.0 / n), (1.0 / 300.0, 0.0, 0.0), (0.0, 1.0 / 300.0, 0.0))

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        x, y, z = point
        if z <= 0.0 or hypot(x, y) / z > 0.684:
            return NoRay()
        return (320.0 + 300.0 * x / z, 240.0 + 300.0 * y / z)


class Clocks:
    def __init__(self, *, known: bool = True, sigma_s: float = 0.0005) -> None:
        self.known = known
        self.sigma_s = sigma_s

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        return HostNs(boot_ns + HOST_FROM_BOOT_NS) if self.known else Unpaired(Reason.NO_CLOCK)

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        return BootNs(host_ns - HOST_FROM_BOOT_NS) if self.known else Unpaired(Reason.NO_CLOCK)

    def sigma_s_at(self, host_ns: HostNs) -> float:
        return self.sigma_s

    def rate_at(self, host_ns: HostNs) -> float:
        return 1.0


class World:
    def __init__(self, *, relative: bool | None = False) -> None:
        self.relative = relative


class StillVehicle:
    """Level, heading north, 10 m above home; ``newest_ns`` is how far its attitudes reach."""

    def __init__(self, *, clock: Clocks | None = None, relative: bool | None = False, **state: Any) -> None:
        self.clock = clock or Clocks()
        self.world = World(relative=relative)
        self.newest_ns = BootNs(10**18)
        self.asked: list[BootNs] = []
        self._state = VehicleState(
            **{
                "boot_ns": BootNs(0),
                "ned_from_body": (1.0, 0.0, 0.0, 0.0),
                "rates": (0.0, 0.0, 0.0),
                "attitude_sigma": 0.0,
                "gap_s": 0.002,
                "position_ned": (100.0, 50.0, -10.0),
                "velocity_ned": (0.0, 0.0, 0.0),
                "position_sigma_m": 0.0,
                "height_above_home_m": 10.0,
                "stamp_sigma_s": 0.0003,
                **state,
            }
        )

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        self.asked.append(boot_ns)
        if boot_ns > self.newest_ns:
            return Unpaired(Reason.STALE_ATTITUDE, (boot_ns - self.newest_ns) * 1e-9)
        return msgspec.structs.replace(self._state, boot_ns=boot_ns)

    def ready_for(self, boot_ns: BootNs) -> bool:
        return boot_ns <= self.newest_ns


def frame(*pixels: tuple[float, float], boot_ms: float = 5000.0, after_ms: float = 60.0, **changed: Any) -> Frame:
    """A frame stamped on the host's clock at this instant of the autopilot's; it arrives ``after_ms`` later."""
    stamp_ns = HOST_FROM_BOOT_NS + round(boot_ms * MS)
    plain = {
        "number": None,
        "stamp_ns": stamp_ns,
        "stamp_clock": StampClock.HOST,
        "arrival_ns": HostNs(stamp_ns + round(after_ms * MS)),
        "detections": tuple(Detection(u, v) for u, v in pixels),
    }
    return Frame(**{**plain, **changed})


def pairer(**changed: Any) -> Pairer:
    return Pairer(**{"lens": Pinhole(), "body_from_camera": DOWN, **changed})
