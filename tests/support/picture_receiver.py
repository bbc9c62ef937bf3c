"""A picture with its decoders, fed by messages that pymavlink encodes."""

from __future__ import annotations

from math import nan

from picture_vehicles import HOME
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.target_messages import TargetMessages
from fwav_companion.ground.vehicle_messages import VehicleMessages
from fwav_companion.ground.views import TargetView
from fwav_companion.mavlink.wire.codec import decode
from fwav_companion.mavlink.wire.scanner import Scanner

NOW = 1_790_000_000.0
COPTER, ARDUPILOT, ARMED = 2, 3, 128


class Receiver:
    """A picture with its decoders, fed by messages of pymavlink."""

    def __init__(self, **options) -> None:
        self.picture = GroundPicture()
        self._vehicles = VehicleMessages(self.picture, **options)
        self._targets = TargetMessages(self.picture)
        self._scanner = Scanner(datagrams=True)

    def take(self, component: int, message, *, system: int = 1, now: float = NOW) -> None:
        for frame in self._scanner.feed(message.pack(dialect.MAVLink(None, system, component))):
            decoded = decode(frame)
            self._vehicles.on_message(decoded, now)
            if self._vehicles.knows(decoded.system):
                self._targets.on_message(decoded, now)

    def flush(self, now: float = NOW) -> None:
        self._vehicles.flush(now)
        self._targets.flush(now)
        self.picture.advance(now)


def heartbeat(mode: int = ARMED):
    return dialect.MAVLink_heartbeat_message(COPTER, ARDUPILOT, mode, 0, 4, 3)


def position(lat: float, lon: float, height: float = 20.0, heading: int = 9000):
    scaled = (round(lat * 1e7), round(lon * 1e7), round((HOME[2] + height) * 1e3), round(height * 1e3))
    return dialect.MAVLink_global_position_int_message(1000, *scaled, 300, 400, 0, heading)


def geo_status(lat: float, lon: float, sigma: float, flags: int = 1):
    scaled = (round(lat * 1e7), round(lon * 1e7))
    return dialect.MAVLink_camera_tracking_geo_status_message(
        flags, *scaled, HOME[2], sigma, 0.3, nan, nan, nan, nan, 20.0, nan, nan
    )


def value(name: bytes, number: float):
    return dialect.MAVLink_named_value_float_message(0, name, number)


def text(content: bytes, number: int = 0, sequence: int = 0):
    return dialect.MAVLink_statustext_message(5, content, number, sequence)


def target(number: int, **changes) -> TargetView:
    fields = {"id": f"1/{number}", "vehicle": "1", "state": "confirmed", "lat": 48.0, "lon": 11.0, "first_unix": NOW}
    return TargetView(**{**fields, "seen_unix": NOW, "source": "status", **changes})
