"""Decides which frames are trusted: with a key, signed frames, and unsigned telemetry where the configuration allows
it.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.routing import RADIO_REPORTS, Port
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.signing import Signature, Signer, SigningClock, Verifier

_ANSWERS: Final = frozenset(BY_NAME[name].msgid for name in ("COMMAND_ACK", "GIMBAL_DEVICE_ATTITUDE_STATUS"))
"""Messages that name their receiver but request nothing of it: accepted unsigned on links that accept telemetry so."""
_STEERS: Final = frozenset(
    definition.msgid
    for name, definition in BY_NAME.items()
    if name in {"FOLLOW_TARGET", "MANUAL_CONTROL", "MANUAL_SETPOINT", "SERIAL_CONTROL", "GPS_INPUT", "LANDING_TARGET"}
    or name.startswith(("HIL_", "TRAJECTORY_REPRESENTATION_", "UAVIONIX_ADSB_OUT_C"))
)
"""Messages without a target system that steer the vehicle, its transponder, or replace its sensors."""
_SENSES: Final = frozenset(
    definition.msgid
    for name, definition in BY_NAME.items()
    if name in {"ATT_POS_MOCAP", "DISTANCE_SENSOR", "GPS_RTCM_DATA", "ODOMETRY", "TERRAIN_DATA", "WHEEL_DISTANCE"}
    or name.startswith(("OBSTACLE_DISTANCE", "OPTICAL_FLOW", "VICON_", "VISION_", "GLOBAL_VISION_"))
)
"""Messages without a target system from which an autopilot takes its position, height or obstacles. On the vehicle's
own links they are telemetry; a station's link has no such sensor of the vehicle."""


class SigningPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """Signing configuration: every frame of ours is signed with the key, and only signed frames are read."""

    key: bytes
    """Signing key, 32 bytes."""
    timestamp: int
    """First timestamp, from :func:`~fwav_companion.mavlink.wire.signing.starting_timestamp`."""
    accept_unsigned: frozenset[str] = frozenset()
    """Links on which unsigned telemetry is read as well; an unsigned request to us never is."""


class Trust(Enum):
    """Trust level of a frame."""

    OPEN = "open"
    """No key is configured."""
    SIGNED = "signed"
    """Its signature was verified."""
    UNSIGNED = "unsigned"
    """Unsigned telemetry on a link that accepts it."""
    UNSIGNED_REQUEST = "unsigned_request"
    """Unsigned request to its receiver, or what would steer it, on a link that accepts unsigned telemetry: we do not
    execute it."""
    RADIO = "radio"
    """Report of a radio, which cannot sign: read on every link."""
    NONE = "none"
    """Unsigned on a link that does not accept it, or signed with another key."""
    LATE_COPY = "late_copy"
    """Genuine, with a timestamp that is not newer than its stream's, or more than a minute behind ours."""


class Keyring:
    """Signs our frames and judges received ones with the key, if there is one."""

    def __init__(self, policy: SigningPolicy | None) -> None:
        self.clock = SigningClock(policy.timestamp) if policy else None
        self._policy = policy
        self.has_key = policy is not None
        """Whether a key is configured."""
        self._verifier = Verifier(policy.key, self.clock) if policy and self.clock else None

    def signer(self, port: Port) -> Signer | None:
        """Return the signer of one link, which has a link id of its own; None without a key."""
        return Signer(self._policy.key, port.index & 0xFF, self.clock) if self._policy and self.clock else None

    def judge(self, port: Port, frame: RawFrame, now: HostNs) -> Trust:
        """Return the trust level of a frame."""
        if self._verifier is None:
            return Trust.OPEN
        if frame.signed:
            return self._judge_signature(self._verifier, port, frame, now)
        if frame.known and frame.msgid in RADIO_REPORTS:
            return Trust.RADIO
        if self._policy is None or port.name not in self._policy.accept_unsigned:
            port.refused_unsigned += 1
            return Trust.NONE
        asks = _asks(frame) or (port.is_gcs and frame.msgid in _SENSES)
        return Trust.UNSIGNED_REQUEST if asks else Trust.UNSIGNED

    def _judge_signature(self, verifier: Verifier, port: Port, frame: RawFrame, now: HostNs) -> Trust:
        verdict = verifier.verify(frame.data, frame.system, frame.component, now)
        match verdict:
            case Signature.GENUINE:
                return Trust.SIGNED
            case Signature.REPLAYED | Signature.OUTDATED:
                port.outdated += verdict is Signature.OUTDATED
                return Trust.LATE_COPY
            case _:
                port.refused_signatures += 1
                return Trust.NONE


def _asks(frame: RawFrame) -> bool:
    """Return whether a frame requests something of its receiver, or may do so because its id is unknown."""
    if frame.definition is None or frame.msgid in _STEERS:
        return True
    return frame.definition.target_system_offset >= 0 and frame.msgid not in _ANSWERS
