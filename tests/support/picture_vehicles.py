"""Simulated vehicles that send MAVLink to a ground station, encoded with pymavlink."""

from __future__ import annotations

import socket
from contextlib import suppress
from math import cos, radians, sin

from pymavlink.dialects.v20 import ardupilotmega as dialect

HOME = (48.1371999, 11.5756003, 519.2)
M_A_DEGREE = 111_320.0


def place_of(north: float, east: float) -> tuple[float, float]:
    """Latitude and longitude of a place in metres about HOME, for a spherical earth: good to 1 % here."""
    return HOME[0] + north / M_A_DEGREE, HOME[1] + east / (M_A_DEGREE * cos(radians(HOME[0])))


class PictureVehicle:
    """One vehicle with its companion: messages over UDP."""

    def __init__(self, port: int, system: int = 1) -> None:
        self.system = system
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.setblocking(False)
        self._sends = {component: dialect.MAVLink(None, system, component) for component in (1, 100, 191)}
        self._parser = dialect.MAVLink(None)
        self._boot_ms = 0

    def send(self, component: int, message) -> None:
        """Send one message of a component."""
        with suppress(ConnectionRefusedError):  # the ground process is not up
            self._socket.send(message.pack(self._sends[component]))

    def beat(self) -> None:
        """Heartbeats of autopilot, companion and camera."""
        self.send(1, dialect.MAVLink_heartbeat_message(2, 3, 128, 0, 4, 3))
        self.send(191, dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        self.send(100, dialect.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3))

    def beat_companion(self) -> None:
        """Heartbeat of the companion alone: the autopilot has died."""
        self.send(191, dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))

    def fly(self, north: float, east: float, *, height: float = 20.0, heading_deg: float = 45.0) -> None:
        """Position and attitude."""
        lat, lon = place_of(north, east)
        self._boot_ms += 100
        position = (round(lat * 1e7), round(lon * 1e7), round((HOME[2] + height) * 1e3), round(height * 1e3))
        heading = round(heading_deg * 100) % 36000
        self.send(1, dialect.MAVLink_global_position_int_message(self._boot_ms, *position, 300, 0, 0, heading))
        yaw = radians(heading_deg)
        self.send(1, dialect.MAVLink_attitude_message(self._boot_ms, 0.05 * sin(yaw), 0.0, yaw, 0.0, 0.0, 0.0))

    def health(self) -> None:
        """Battery and GNSS."""
        none = (0,) * 6
        self.send(1, dialect.MAVLink_sys_status_message(0, 0, 0, 0, 15800, -1, 72, *none))
        self.send(1, dialect.MAVLink_gps_raw_int_message(0, 3, 0, 0, 519200, 0, 0, 0, 0, 14, 565700))

    def camera(self) -> None:
        """Optics: 60 by 47 degrees."""
        words = (b"fwav", b"camera")
        vendor, model = ([*word.ljust(32, b"\0")] for word in words)
        message = dialect.MAVLink_camera_information_message(
            0, vendor, model, 0, 6.0, 6.93, 5.2, 640, 480, 0, 3584, 0, b""
        )
        self.send(100, message)

    def target(self, north: float, east: float, *, track: int, radius95: float, sigma: float, flags: int = 1) -> None:
        """The selected target."""
        lat, lon = place_of(north, east)
        for name, value in ((b"TGT_ID", track), (b"TGT_R95", radius95)):
            self.send(191, dialect.MAVLink_named_value_float_message(self._boot_ms, name, value))
        nan = float("nan")
        self.send(
            100,
            dialect.MAVLink_camera_tracking_geo_status_message(
                flags, round(lat * 1e7), round(lon * 1e7), HOME[2], sigma, 0.3, nan, nan, nan, nan, 20.0, nan, nan
            ),
        )

    def say(self, text: str, severity: int = 5, component: int = 191) -> None:
        """A text of one chunk or several."""
        data = text.encode()
        chunks = [data[at : at + 50] for at in range(0, len(data), 50)]
        number = 0 if len(chunks) == 1 else 7
        for sequence, chunk in enumerate(chunks):
            self.send(component, dialect.MAVLink_statustext_message(severity, chunk, number, sequence))

    def heard(self) -> list:
        """Messages of the ground station since the last call."""
        found = []
        while True:
            try:
                data = self._socket.recv(65536)
            except (BlockingIOError, ConnectionRefusedError):
                return found
            found += self._parser.parse_buffer(data) or []

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()
