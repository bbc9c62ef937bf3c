"""MAVLink messages, received and to be sent, and notices for people."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum, unique
from typing import Any

import msgspec


class Message(msgspec.Struct, frozen=True, gc=False):
    """A decoded MAVLink message, received or recorded."""

    name: str
    """MAVLink name, as ATTITUDE."""
    system: int
    """System id of the sender."""
    component: int
    """Component id of the sender."""
    link: str
    """Name of the link on which it arrived; "" in a recording."""
    fields: Any
    """Record with the fields of the definition as attributes, in its order; iterates as a tuple. Arrays are tuples,
    text is str."""
    signed: bool = False
    """Whether it carried a signature that was verified."""


class Destination(StrEnum):
    """Destination of an outgoing message; it determines the links."""

    AUTOPILOT = "autopilot"
    """The adopted autopilot, on the links where it was received."""
    GROUND = "ground"
    """Ground stations: every gcs link, and the autopilot's link while no station is received on a gcs link."""
    GROUND_LINKS = "ground_links"
    """Every gcs link."""
    EVERYONE = "everyone"
    """All links, for heartbeats."""
    REPLY = "reply"
    """The one link in :attr:`Outgoing.link`."""


@unique
class NoticeCode(StrEnum):
    """Stable names of the notices. Programs and tests read the code; the wording may change."""

    AUTOPILOT_FOUND = "autopilot_found"
    SEVERAL_AUTOPILOTS = "several_autopilots"
    NEIGHBOUR_HEARD = "neighbour_heard"
    """Another vehicle is heard beside ours."""
    AUTOPILOT_REPLACED = "autopilot_replaced"
    """Another autopilot was adopted in place of the former one."""
    AUTOPILOT_LOST = "autopilot_lost"
    AUTOPILOT_BACK = "autopilot_back"
    AUTOPILOT_REBOOTED = "autopilot_rebooted"
    CLOCK_SLIPPED = "clock_slipped"
    CLOCK_RATE = "clock_rate"
    """The autopilot's clock runs at another rate than a crystal's, or at a crystal's again."""

    OWN_IDS_ON_GCS = "own_ids_on_gcs"
    """Frames with the autopilot's ids came on a link that is not an autopilot's."""
    ID_CONFLICT = "id_conflict"
    """A second program uses our ids."""
    SIGNING_AHEAD = "signing_ahead"
    """The signing time is more than a minute ahead of UTC."""
    SIGNED_IN_THE_PAST = "signed_in_the_past"
    """Frames of a sender were refused that is more than a minute behind our signing time."""
    BYTES_SHED = "bytes_shed"
    """Bytes of a link were skipped unread: examining them would cost too much."""

    READY = "ready"
    NOT_READY_PICTURES_REFUSED = "not_ready_pictures_refused"
    NOT_READY_NO_ATTITUDE = "not_ready_no_attitude"
    NOT_READY_NO_CLOCK = "not_ready_no_clock"
    NOT_READY_NO_PICTURES = "not_ready_no_pictures"
    NOT_READY_NO_POSITION = "not_ready_no_position"
    NOT_READY_NO_HEIGHT = "not_ready_no_height"
    NOT_READY_NO_GIMBAL = "not_ready_no_gimbal"
    NOT_READY_SLOW_ATTITUDE = "not_ready_slow_attitude"

    TARGET_FOUND = "target_found"
    TARGET_LOST = "target_lost"
    TARGET_MERGED = "target_merged"
    """Two tracks proved to be one target."""
    CLICK_WITHOUT_CAMERA = "click_without_camera"
    CLICK_WITHOUT_TARGET = "click_without_target"
    COT_WITHOUT_POSITION = "cot_without_position"
    COT_WITHOUT_GEOID = "cot_without_geoid"
    COT_WITHOUT_UTC = "cot_without_utc"

    ORIGIN_SET = "origin_set"
    GIMBAL_UNUSED = "gimbal_unused"
    """A gimbal is heard, and the camera is configured as fixed."""
    RELATIVE_WORLD = "relative_world"
    HOME_MOVED = "home_moved"
    TERRAIN_PLACED = "terrain_placed"
    ATTITUDE_SOURCE = "attitude_source"
    PITCH_TRIM_RESTORED = "pitch_trim_restored"
    ATTITUDE_STAMPS = "attitude_stamps"

    RATES_TAKEN = "rates_taken"
    """Another program asked the autopilot for other rates."""
    RATE_FELL = "rate_fell"
    RATE_REFUSED = "rate_refused"
    """A lower rate than the wanted one was accepted."""
    MESSAGE_REFUSED = "message_refused"
    """Refused at every rate."""
    INTERVALS_UNKNOWN = "intervals_unknown"
    """The autopilot has no SET_MESSAGE_INTERVAL."""

    READOUT_UNKNOWN = "readout_unknown"
    """The unknown readout limits the accuracy."""
    MOUNT_MISTAKE = "mount_mistake"
    CALIBRATION_RESULT = "calibration_result"
    CALIBRATION_DROPPED = "calibration_dropped"
    PRIOR_EXCEEDED = "prior_exceeded"
    """The flight shows an error beyond its configured prior."""


class Severity(StrEnum):
    """How urgent a notice is; in the log NOTICE is shown as INFO, as STATUSTEXT it has a level of its own."""

    INFO = "info"
    NOTICE = "notice"
    WARNING = "warning"
    ERROR = "error"


class Notice(msgspec.Struct, frozen=True):
    """One line for the log, and for ground stations where ``to_ground`` is set."""

    code: NoticeCode
    severity: Severity
    text: str
    to_ground: bool = False


class Outgoing(msgspec.Struct, frozen=True, kw_only=True):
    """A message of ours that is to be sent."""

    name: str
    """Its MAVLink name."""
    fields: Mapping[str, Any]
    """Values by field name; an extension field left out is 0."""
    to: Destination
    component: int
    """The component of ours that sends it: the companion or its camera."""
    link: str = ""
    """For REPLY: the link on which the request arrived."""
    notice: NoticeCode | None = None
    """For STATUSTEXT: the code of the notice that it carries."""
