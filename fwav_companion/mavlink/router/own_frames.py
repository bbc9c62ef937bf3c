"""What is ours: the frames that we sent, to distinguish their echo from frames of a second program with our ids, and
the messages that nobody else may send to the vehicle with these ids.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import msgspec

from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.frames import RawFrame

MAX_SENT: Final = 4096
"""Frames of ours that are remembered: 20 s at 200 frames a second, four links included. An echo through a second radio
is up to several seconds late. Memory: 4096 x 120 bytes."""
_FOLLOW_TARGET: Final = BY_NAME["FOLLOW_TARGET"].msgid
_OWN_REPORTS: Final = frozenset(
    BY_NAME[name].msgid
    for name in (
        *("HEARTBEAT", "LANDING_TARGET", "DISTANCE_SENSOR", "FOLLOW_TARGET", "GIMBAL_MANAGER_SET_PITCHYAW"),
        *("CAMERA_TRACKING_GEO_STATUS", "CAMERA_TRACKING_IMAGE_STATUS", "CAMERA_INFORMATION", "CAMERA_SETTINGS"),
        *("CAMERA_CAPTURE_STATUS", "STORAGE_INFORMATION", "VIDEO_STREAM_INFORMATION", "VIDEO_STREAM_STATUS"),
        *("STATUSTEXT", "NAMED_VALUE_FLOAT", "ADSB_VEHICLE", "ONBOARD_COMPUTER_STATUS"),
        *("COMMAND_ACK", "MESSAGE_INTERVAL", "AUTOPILOT_VERSION"),
    )
)
"""Messages that the vehicle acts on or shows as this service's word: with our ids they come from us alone. What we send
besides is a request, which any sender may make with ids of its own; so that a second program which has ours by mistake
(MAVROS's are 1/191) keeps its commands, parameters and clock until they are changed."""


class OwnIds(msgspec.Struct, frozen=True):
    """Ids that we send with."""

    components: tuple[int, ...] = ()
    """Our components, the companion's first; they share the vehicle's system id."""
    follow_system: int = 0
    """System id of the companion's FOLLOW_TARGET; 0: the vehicle's."""

    def has(self, frame: RawFrame, system: int) -> bool:
        """Return whether the frame carries ids that we send it with. ``system``: our id."""
        if frame.component not in self.components:
            return False
        follows = frame.msgid == _FOLLOW_TARGET and frame.component == self.components[0]
        return frame.system == system or (follows and 0 < frame.system == self.follow_system)


DEFAULT_IDS: Final = OwnIds((191, 100))
"""MAV_COMP_ID_ONBOARD_COMPUTER and MAV_COMP_ID_CAMERA of the vehicle."""


def is_report(frame: RawFrame) -> bool:
    """Return whether the message, with our ids, is of this service alone."""
    return frame.msgid in _OWN_REPORTS


class OwnFrames:
    """The newest frames of ours, by a hash of all their bytes."""

    def __init__(self) -> None:
        self._order: deque[int] = deque()
        self._hashes: dict[int, None] = {}
        """A dict, because a set that loses an entry with each new one is rebuilt with eight times as many slots: 0.5 MB
        in place of 0.3, and twice that while it is copied."""

    def add(self, frame: bytes) -> None:
        """Take a frame that leaves."""
        key = hash(frame)
        if key in self._hashes:
            return
        self._hashes[key] = None
        self._order.append(key)
        if len(self._order) > MAX_SENT:
            del self._hashes[self._order.popleft()]

    def __contains__(self, frame: bytes) -> bool:
        """Return whether the frame was sent by us lately."""
        return hash(frame) in self._hashes
