"""What goes out: messages, recordings, kept state, the status file."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from fwav_companion.config.inputs import NotNegative, Positive, Section
from fwav_companion.links.url import TcpUrl, UdpUrl, parse_cot_url


class PublishConfig(Section, frozen=True):
    """[publish]: which target is told to whom."""

    select: Literal["best", "operator"] = "best"
    """``best``: the oldest confirmed track; ``operator``: only what was clicked."""
    label: str = ""
    """Only tracks of this label are selected; "": any."""
    rate_hz: Annotated[float, Meta(gt=0, le=100)] = 10.0
    """Of the tracking messages, hertz."""
    camera_tracking: bool = True
    """The camera component with its tracking messages."""
    landing_target: bool = False
    """Whether LANDING_TARGET steers the autopilot's landing."""
    landing_label: str = ""
    """Required with landing_target: only the oldest confirmed track of this label is sent."""
    landing_max_sigma_m: Positive = 0.5
    """One sigma, larger semi-axis, of the target relative to the vehicle, metres; beyond it nothing is sent."""
    statustext: bool = True
    """Texts for people: found, lost, trouble, ready."""
    named_values: bool = True
    """NAMED_VALUE_FLOAT for Mission Planner's quick view."""
    adsb: bool = False
    """ADSB_VEHICLE as a map marker, on gcs links only."""
    cot: str = ""
    """Where Cursor on Target is sent, as udpout://239.2.3.1:6969; "": nowhere."""
    cot_type: Annotated[str, Meta(pattern=r"^[a-z](-[A-Za-z0-9]+)+$", description="a CoT type, as a-u-G")] = "a-u-G"
    """The event's type."""
    cot_callsign: str = ""
    """How the target is called on the map; "": by its label and number."""
    cot_rate_hz: Annotated[float, Meta(gt=0, le=10)] = 1.0
    """Hertz."""
    cot_stale_s: Positive = 10.0
    """For how long an event holds, seconds."""
    video_uri: str = ""
    """Told to ground stations, so that they offer tracking on the picture; "": none."""
    video_delay_s: Annotated[float, Meta(ge=0, le=30)] = 0.3
    """A click means the picture of that long ago, seconds."""

    @property
    def parsed_cot(self) -> UdpUrl | TcpUrl | None:
        """Where Cursor on Target goes; None for nowhere."""
        return parse_cot_url(self.cot) if self.cot else None


class RecordConfig(Section, frozen=True):
    """[record]: what a flight leaves behind."""

    directory: str = ""
    """Path; "": nothing is recorded."""
    when: Literal["always", "armed"] = "always"
    """Whether recording waits for arming."""
    sync_s: Annotated[float, Meta(gt=0, le=3600)] = 1.0
    """A power cut loses at most this, seconds."""
    max_used_mb: NotNegative = 4096.0
    """All recordings together, 10^6 bytes: about a day of flight. 0: no limit."""
    min_free_mb: NotNegative = 200.0
    """Stays free on the disk, 10^6 bytes: what a system needs for its logs, its updates and a login."""
    remove_oldest: bool = False
    """Whether the oldest recordings make room for new ones; else recording stops there, and says so."""


class StateConfig(Section, frozen=True):
    """[state]: what is kept between flights."""

    directory: str = ""
    """Path; "": $STATE_DIRECTORY, and where that is unset nothing is kept."""


class StatusConfig(Section, frozen=True):
    """[status]: the file that ``check`` and scripts read."""

    file: str = ""
    """Path; "": status.json in the first runtime directory that may be written."""
