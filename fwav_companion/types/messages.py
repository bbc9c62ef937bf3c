"""MAVLink messages, received and to be sent, and notices for people."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum, unique
from typing import Any

import msgspec

ATTITUDE_MESSAGES = frozenset({"ATTITUDE", "ATTITUDE_QUATERNION"})
"""Names of the messages with the vehicle's attitude."""


class Message(msgspec.Struct, frozen=True, gc=False):
    """A decoded MAVLink message, received or recorded."""

    name: str
    """MAVLink name, as ATTITUDE."""
    system: int
    """System id of the sender."""
    component: int
    """Component id of the sender."""
    link: str
    """Name of the link on which the message arrived; "" in a recording."""
    fields: Any
    """Record with the fields of the message definition as attributes, in the definition's order. It iterates as a
    tuple. Arrays are tuples, text is str."""
    signed: bool = False
    """Whether the message carried a signature that was verified."""
    foreign_bytes: int = 0
    """Bytes of other systems' frames before a TIMESYNC, since the start of the receiver; 0 for all other messages."""


class Destination(StrEnum):
    """Destination of an outgoing message. It determines the links on which the message leaves."""

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
    """The autopilot was adopted: its telemetry is used from now on."""
    SEVERAL_AUTOPILOTS = "several_autopilots"
    """More than one autopilot is heard at the start, and none is adopted. Set [vehicle] system_id."""
    NEIGHBOUR_HEARD = "neighbour_heard"
    """Another vehicle is heard beside ours."""
    AUTOPILOT_REPLACED = "autopilot_replaced"
    """Another autopilot was adopted in place of the former one."""
    AUTOPILOT_LOST = "autopilot_lost"
    """The autopilot has sent no heartbeat for 5 s. Check its power and the link to it."""
    AUTOPILOT_BACK = "autopilot_back"
    """The autopilot sends heartbeats again."""
    AUTOPILOT_REBOOTED = "autopilot_rebooted"
    """The autopilot's boot time went back and stays back: clock and message rates start again."""
    CLOCK_SLIPPED = "clock_slipped"
    """The autopilot's clock jumped without a reboot, as in a simulator under load; it is followed."""
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

    RATE_REQUESTS_REJECTED = "rate_requests_rejected"
    """A station requested message rates more often than twice a second: the others were rejected."""

    OVERLOAD = "overload"
    """Frames were dropped that came faster than the processor handles them."""

    STARTED_ANEW = "started_anew"
    """Internal faults repeated: localization, tracking and the vision process start anew. Report the log."""

    READY = "ready"
    """The service localizes: it reports its rates and the accuracy to expect."""
    NOT_READY_PICTURES_REFUSED = "not_ready_pictures_refused"
    """Frames arrive and are refused. `check` names the reason."""
    NOT_READY_NO_ATTITUDE = "not_ready_no_attitude"
    """No attitude arrives. Let the autopilot send ATTITUDE or ATTITUDE_QUATERNION on this link."""
    NOT_READY_NO_CLOCK = "not_ready_no_clock"
    """The autopilot's clock is not known yet. If it stays so, TIMESYNC does not come back: check TX."""
    NOT_READY_NO_PICTURES = "not_ready_no_pictures"
    """No frame arrives from the camera or the detector. Check that it runs."""
    NOT_READY_NO_POSITION = "not_ready_no_position"
    """No global position arrives. Wait for GPS, or set [vehicle] position = "none"."""
    NOT_READY_NO_HEIGHT = "not_ready_no_height"
    """The height above ground is not known. Wait for the position, or check the rangefinder."""
    NOT_READY_NO_GIMBAL = "not_ready_no_gimbal"
    """No attitude of the gimbal arrives. Check gimbal_device_id."""
    NOT_READY_SLOW_ATTITUDE = "not_ready_slow_attitude"
    """Attitudes are too slow for the vehicle's motion. Raise [rates] attitude or the link's speed."""

    TARGET_FOUND = "target_found"
    """A target was confirmed: its place and 95 % accuracy."""
    TARGET_LOST = "target_lost"
    """A target was looked for and not seen, or not in view for longer than it is kept."""
    TARGET_MERGED = "target_merged"
    """Two tracks proved to be one target."""
    LANDING_IN_SIGHT = "landing_in_sight"
    """The landing target is seen and LANDING_TARGET flows: its offset from the vehicle, and the 95 % accuracy."""
    LANDING_LOST = "landing_lost"
    """The landing target has not been seen for a second; its prediction ends half a second later."""
    LANDED = "landed"
    """The vehicle landed on the target: where the target was in the last message, and how long ago that was."""
    LANDING_WITHHELD = "landing_withheld"
    """A landing target is known, and LANDING_TARGET has been withheld for a second. The text has the reason."""
    LANDING_SENT = "landing_sent"
    """LANDING_TARGET flows after it was reported as withheld."""
    PAD_CONTRADICTED = "pad_contradicted"
    """A tag is not where its [[pad]] has it, as the pad's other tags show: it is left out. Check the pad's tags."""
    CROWDED = "crowded"
    """Most detections of a label fit no track: its new tracks wait for their confirmation. Raise the threshold."""
    CLICK_WITHOUT_CAMERA = "click_without_camera"
    """A station clicked on the picture, and no camera is configured. Set [camera] calibration."""
    CLICK_WITHOUT_TARGET = "click_without_target"
    """A station clicked where no target is. Click on a target."""
    CLICK_AMBIGUOUS = "click_ambiguous"
    """A station clicked where several targets were at about that time. Click nearer to one."""
    CLICK_REFUSED = "click_refused"
    """A clicked spot cannot be followed: it is too uniform, at the edge, or the picture is gone. Click on another."""
    ACT_STARTED = "act_started"
    """The service acts on the target that an operator selected: the text says how. STOP of tracking ends it."""
    ACT_ENDED = "act_ended"
    """It ended; the text has the reason. Select the target again to go on."""
    ACT_REFUSED = "act_refused"
    """It is not done, because the selection does not count or the other side refuses; the text has the reason."""
    ACT_MISCONFIGURED = "act_misconfigured"
    """At the start, on the ground: [act] follow_system_id is another's. The service ends with exit status 2."""
    ACT_WITHHELD = "act_withheld"
    """It rests for the reason in the text: the claim is too wide, the gimbal is at its limit, or the target jumped."""
    COT_WITHOUT_POSITION = "cot_without_position"
    """Cursor on Target rests without a global position. Wait for the autopilot's GPS."""
    COT_WITHOUT_UTC = "cot_without_utc"
    """Cursor on Target rests while UTC is unknown. Wait for GPS, or run NTP on the board."""

    FLEET_WITHOUT_UTC = "fleet_without_utc"
    """Nothing is shared with the fleet while UTC is unknown. Wait for GPS, or run NTP on the board."""
    FLEET_WITHOUT_POSITION = "fleet_without_position"
    """Nothing is shared with the fleet without a position. Wait for the autopilot's GPS, or its good local position."""

    ORIGIN_SET = "origin_set"
    """The first global position was received: the local frame has its origin."""
    GIMBAL_UNUSED = "gimbal_unused"
    """A gimbal is heard, and the camera is configured as fixed."""
    GIMBAL_HEADING = "gimbal_heading"
    """The gimbal's own heading of the vehicle differs from the autopilot's by more than 10 deg: the autopilot's is
    used. Calibrate the gimbal's compass, or set its yaw zero."""
    RELATIVE_WORLD = "relative_world"
    """No global position came within 10 s: targets are relative to the point below the camera."""
    LOCAL_WORLD = "local_world"
    """No global position came, and the autopilot vouches for its local one: targets are in its local frame, without a
    place on the earth."""
    POSITION_SOURCE = "position_source"
    """A global position came or was lost in flight: the vehicle's positions come from the other source, and the tracks
    stay."""
    HOME_MOVED = "home_moved"
    """The autopilot's home changed: the `home` ground surface moves with it."""
    POSITION_JUMPED = "position_jumped"
    """The autopilot's position jumped beyond its velocity."""
    TERRAIN_PLACED = "terrain_placed"
    """The elevation model was shifted to the take-off height."""
    ATTITUDE_SOURCE = "attitude_source"
    """Attitudes now come from the other message."""
    PITCH_TRIM_RESTORED = "pitch_trim_restored"
    """ArduPlane's ATTITUDE lacks the pitch trim: the service adds it."""
    ATTITUDE_STAMPS = "attitude_stamps"
    """The delay of attitude stamps that is corrected, or that there is none."""

    RATES_TAKEN = "rates_taken"
    """Another program asked the autopilot for other rates."""
    RATE_FELL = "rate_fell"
    """A message became slower than agreed, and is requested again."""
    RATE_REFUSED = "rate_refused"
    """A lower rate than the wanted one was accepted."""
    MESSAGE_REFUSED = "message_refused"
    """Refused at every rate."""
    INTERVALS_UNKNOWN = "intervals_unknown"
    """The autopilot has no SET_MESSAGE_INTERVAL."""

    LANDMARK_USED = "landmark_used"
    """The first sights of a landmark agree with all else."""
    LANDMARKS_NOT_APPLIED = "landmarks_not_applied"
    """[tracking] chooses a filter or a motion that landmarks do not correct."""
    LANDMARKS_CONTRADICT = "landmarks_contradict"
    """Landmarks contradict one another, and the flight does not show which is wrong."""
    LANDMARK_LEFT_OUT = "landmark_left_out"
    """A landmark disagrees with all else by more than its claim."""
    READOUT_UNKNOWN = "readout_unknown"
    """The unknown readout limits the accuracy."""
    MOUNT_MISTAKE = "mount_mistake"
    """The camera's mount is configured wrongly by a whole axis. The text names the angles to check."""
    CALIBRATION_RESULT = "calibration_result"
    """Self-calibration changed its status: the delay and mount found, or what hides them."""
    CALIBRATION_DROPPED = "calibration_dropped"
    """The camera has moved since an earlier flight: the calibration of that flight is dropped."""
    PRIOR_EXCEEDED = "prior_exceeded"
    """The flight shows an error beyond its configured prior."""
    SOLVES_LATE = "solves_late"
    """Solves of the smoother were not ready at their take-over."""


class Severity(StrEnum):
    """Urgency of a notice. The log shows NOTICE as INFO; STATUSTEXT has a level of its own for NOTICE."""

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
    """A message that the service is to send."""

    name: str
    """Its MAVLink name."""
    fields: Mapping[str, Any]
    """Values by field name; an extension field left out is 0."""
    to: Destination
    component: int
    """Component id that sends it: the companion or its camera."""
    system: int = 0
    """System id that sends it; 0: the vehicle's, as for all but [act] follow_system_id."""
    link: str = ""
    """For REPLY: the link on which the request arrived."""
    notice: NoticeCode | None = None
    """For STATUSTEXT: the code of the notice that it carries."""
