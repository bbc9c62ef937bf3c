"""Acts on the selected target as [act] says: decides what is sent, and says why it starts and ends. Pure."""

from __future__ import annotations

from collections import deque
from math import degrees
from typing import Final

from fwav_companion.acting.aim import measured_look
from fwav_companion.acting.follow import Follow
from fwav_companion.acting.gimbal_manager import Control, GimbalManager
from fwav_companion.acting.gimbal_watch import GimbalWatch
from fwav_companion.acting.options import ActOptions
from fwav_companion.acting.permission import End, Permission
from fwav_companion.acting.pointing import Pointing
from fwav_companion.acting.roi import Roi
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.types.commands import Command
from fwav_companion.types.flight_status import ActingReport
from fwav_companion.types.messages import Message, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.situation import Autopilot, Situation
from fwav_companion.types.tracks import Track

POINTING_NS: Final = 50 * NS_PER_MS
"""Interval of the gimbal's commands: managers take 10 to 20 Hz."""
TICK_NS: Final = 100 * NS_PER_MS
"""Interval at which the others look whether they are due."""
ONLY_POINTING: Final = frozenset(
    {End.MODE_CHANGED, End.GIMBAL_MODE, End.CONTROL_TAKEN, End.STICK, End.GIMBAL_STUCK, End.REFUSED}
)
"""Ends of the pointing that leave FOLLOW_TARGET alone."""
START_NS: Final = 10 * NS_PER_S
"""Time from the first autopilot in which a heard follow_system_id ends a service on the ground: a start is watched, and
ten heartbeats of another system are in it."""
OLDEST_PICTURE_NS: Final = 5 * NS_PER_S
"""Age of the newest picture after which the target is not acted on: without pictures no track ends."""
MOST_NOTICES: Final = 64


class Acting:
    """Decides on every message and at every tick; only :meth:`on_wake` returns what is to be sent."""

    def __init__(self, options: ActOptions) -> None:
        self._options = options
        self._permission = Permission(options)
        self._gimbal = GimbalManager(options.gimbal_device_id, options.companion_component)
        self._pointing, self._watch = Pointing(options), GimbalWatch()
        self._roi = Roi(options.companion_component)
        self._follow = Follow(options)
        self._track: Track | None = None
        self._points = False
        """Whether the pointing has not ended since the selection."""
        self._began_control = False
        self._out: list[Outgoing] = []
        self._notices: deque[Notice] = deque(maxlen=MOST_NOTICES)
        self._told: dict[str, str | None] = {}
        self._last_end: str | None = None
        self._follow_id_heard = self._ends_at_start = self._misconfigured = False
        self._adopted_ns: HostNs | None = None
        """Instant at which the first autopilot was adopted."""
        self._autopilot: Autopilot | None = None
        self.wake_at: HostNs | None = None
        """Instant at which :meth:`on_wake` is due; None while nothing is permitted and nothing is asked."""

    # Inputs.

    def on_message(self, message: Message, autopilot: Autopilot | None, now: HostNs) -> None:
        """Take a message of any sender."""
        if autopilot is not None and (self._autopilot is None or autopilot.system != self._autopilot.system):
            self._on_adopted(now)
        self._autopilot = autopilot
        if message.name == "HEARTBEAT" and 0 < message.system == self._options.follow_system_id:
            self._on_follow_id_heard(message, now)
        self._judge_follow_id(autopilot, now)
        end = self._permission.on_message(message, autopilot, now)
        if end is not None:
            self._end(end, now)
        if self._options.point == "gimbal":
            self._gimbal.on_message(message, autopilot)
            self._judge_control(now)
        elif self._options.point == "roi":
            self._roi.on_message(message, autopilot)

    def on_selected(self, command: Command, track: Track | None, autopilot: Autopilot | None, now: HostNs) -> None:
        """Take an operator's selection that was obeyed. ``track``: None while a clicked spot has no track yet."""
        self._autopilot = autopilot
        refusal = self._permission.select(command, autopilot, now)
        if refusal is not None:
            self._say(NoticeCode.ACT_REFUSED, Severity.NOTICE, f"act: nothing is done, {refusal.value}")
            self._withdraw(now)
            return
        self._track, self._points = track, self._options.point != "none"
        self._told.clear()
        self._roi.begin()
        self._follow.begin()
        if self._options.point == "gimbal" and self._gimbal.control is Control.NONE:
            self._gimbal.begin(now)
            self._began_control = False
        self.wake_at = now

    def on_stopped(self, now: HostNs) -> None:
        """Take an operator's STOP of tracking: the only end that clears a region of interest."""
        if self._permission.selector is not None and self._points and self._autopilot is not None:
            self._out += self._roi.clear(self._autopilot)
        self._end(End.STOPPED, now)

    def on_tracks(self, selected: Track | None, now: HostNs, *, awaited: bool) -> None:
        """Take the operator's target after a frame. ``awaited``: whether a clicked spot has no track yet."""
        if self._permission.selector is None:
            return
        if selected is None and not awaited:
            self._end(End.TARGET_LOST, now)
            return
        if selected is not None and selected is not self._track and self._points:
            self._pointing.on_track(selected)
        self._track = selected

    def on_end(self, end: End, now: HostNs) -> None:
        """Take an event that ends the flight's selection: a reboot, another autopilot, its silence."""
        self._end(end, now)

    # Outputs.

    def on_wake(self, now: HostNs, situation: Situation) -> list[Outgoing]:
        """The messages that are due."""
        end = self._permission.on_wake(now)
        if end is not None:
            self._end(end, now)
        if self._track is not None and now - self._track.host_ns > OLDEST_PICTURE_NS:
            self._end(End.NO_PICTURES, now)
        autopilot = situation.autopilot
        if autopilot is not None and self._gimbal.control is Control.NONE:
            self._out += self._gimbal.on_wake(now, autopilot)
        if self._permission.selector is not None and autopilot is not None:
            if self._points:
                self._out += self._point(situation, autopilot)
            if self._options.follow_target and self._track is not None and not self._follow_id_heard:
                self._out += self._follow.due(self._track, situation)
                self._tell_follow()
        self.wake_at = self._next(now)
        out, self._out = self._out, []
        return out

    def notices(self) -> list[Notice]:
        """Notices since the last call."""
        made = list(self._notices)
        self._notices.clear()
        return made

    def status(self) -> ActingReport:
        """Part of the status."""
        manager = self._gimbal.manager or self._gimbal.heard
        return ActingReport(
            point=self._options.point,
            follow_target=self._options.follow_target,
            acts=self._permission.selector is not None,
            manager=None if manager is None else f"{manager.system}/{manager.component}",
            pitch_limits_deg=None
            if manager is None or manager.limits is None
            else (degrees(manager.limits[0].pitch), degrees(manager.limits[1].pitch)),
            yaw_limits_deg=None
            if manager is None or manager.limits is None
            else (degrees(manager.limits[0].yaw), degrees(manager.limits[1].yaw)),
            primary=None if self._gimbal.primary is None else "{}/{}".format(*self._gimbal.primary),
            last_end=self._last_end,
            follow_id_heard=self._follow_id_heard,
        )

    # Steps.

    def _point(self, situation: Situation, autopilot: Autopilot) -> list[Outgoing]:
        if self._options.point == "roi":
            return self._point_by_roi(situation, autopilot)
        requests = self._gimbal.on_wake(situation.now_ns, autopilot)
        self._judge_control(situation.now_ns)
        if self._gimbal.control is not Control.OURS or self._track is None:
            return requests
        look = measured_look(situation)
        if not self._began_control:
            self._begin_control(situation, self._track)
        command = self._pointing.command(situation)
        if command is None:
            return requests
        now, at_limit = situation.now_ns, self._pointing.at_limit
        self._watch.on_command(command, look, now, at_limit=at_limit)
        self._pointing.trims = not self._watch.is_away
        stuck = self._watch.stuck(command, now)
        if stuck is not None:
            self._end(End.GIMBAL_STUCK, now, stuck)
        elif self._watch.by_stick(now):
            self._end(End.STICK, now)
        self._tell("limit", "act: the gimbal is at its limit" if at_limit else None)
        self._tell("jump", "act: the target jumped, the gimbal holds" if self._pointing.holds else None)
        sent = self._gimbal.point(command)
        return requests if sent is None else [*requests, sent]

    def _begin_control(self, situation: Situation, track: Track) -> None:
        self._began_control = True
        self._watch = GimbalWatch()
        manager = self._gimbal.manager
        self._pointing.limits = None if manager is None else manager.limits
        self._pointing.start(measured_look(situation), situation.now_ns)
        self._pointing.on_track(track)
        self._started(f"act: the gimbal points at {_name(track)}")

    def _point_by_roi(self, situation: Situation, autopilot: Autopilot) -> list[Outgoing]:
        if self._track is None:
            return []
        sent = self._roi.due(self._track, situation, autopilot)
        if self._roi.refusal is not None:
            self._end(End.REFUSED, situation.now_ns, self._roi.refusal)
            return []
        withheld = self._roi.withheld
        self._tell("roi", None if withheld is None else f"act: no ROI is sent, {withheld}")
        if sent and self._told.get("start") is None:
            self._told["start"] = ""
            self._started(f"act: ROI at {_name(self._track)}, the vehicle's nose may turn")
        return sent

    def _judge_control(self, now: HostNs) -> None:
        """End the pointing where the manager refuses, or another took the control or changed the mode."""
        if not self._points:
            return
        if self._gimbal.refusal is not None:
            self._end(End.REFUSED, now, self._gimbal.refusal)
        elif self._gimbal.taken_by is not None:
            self._end(End.CONTROL_TAKEN, now, "{}/{}".format(*self._gimbal.taken_by))
        elif self._gimbal.new_mode is not None:
            self._end(End.GIMBAL_MODE, now, self._gimbal.new_mode)

    def _tell_follow(self) -> None:
        """Report when FOLLOW_TARGET flows and when it rests, each change once."""
        now_text = "flows" if self._follow.withheld is None else f"rests, {self._follow.withheld}"
        if self._told.get("follow") != now_text:
            self._told["follow"] = now_text
            flows = self._follow.withheld is None
            code = NoticeCode.ACT_STARTED if flows else NoticeCode.ACT_WITHHELD
            self._say(code, Severity.NOTICE, f"act: FOLLOW_TARGET {now_text}")

    def _on_adopted(self, now: HostNs) -> None:
        self._adopted_ns = self._adopted_ns or now
        if self._options.point == "gimbal":
            self._gimbal.inquire(now)
            self.wake_at = now

    def _on_follow_id_heard(self, message: Message, now: HostNs) -> None:
        if self._ends_at_start or not self._options.follow_target:
            return
        unsigned_station = not message.signed and message.link in self._options.gcs_links
        if self._options.signed and unsigned_station:
            return  # with a key, an unsigned station withholds nothing
        self._ends_at_start = not unsigned_station  # no stranger's frame may end the service
        if self._follow_id_heard:
            return
        self._follow_id_heard = True
        number = self._options.follow_system_id
        text = f"act: system {number} is heard, set another [act] follow_system_id: nothing is sent"
        self._say(NoticeCode.ACT_REFUSED, Severity.ERROR, text)
        if self._options.point == "none":
            self._withdraw(now)

    def _judge_follow_id(self, autopilot: Autopilot | None, now: HostNs) -> None:
        """Report once that the service cannot start with this id; never of a vehicle that may fly."""
        if not self._ends_at_start or self._misconfigured or autopilot is None or autopilot.armed:
            return
        if self._adopted_ns is not None and now - self._adopted_ns < START_NS:
            self._misconfigured = True
            number = self._options.follow_system_id
            text = f"act: the service ends, system {number} is heard: set another follow_system_id"
            self._say(NoticeCode.ACT_MISCONFIGURED, Severity.ERROR, text)

    def _end(self, end: End, now: HostNs, detail: str = "") -> None:
        """End the pointing, or all; said once where something was permitted."""
        if self._permission.selector is None:
            return
        only_pointing = end in ONLY_POINTING
        if only_pointing and not self._points:
            return
        text = end.value + (f": {detail}" if detail else "")
        what = self._options.point if only_pointing else "all"
        self._last_end = text
        code = NoticeCode.ACT_REFUSED if end is End.REFUSED else NoticeCode.ACT_ENDED
        severity = Severity.WARNING if end in {End.GIMBAL_STUCK, End.REFUSED, End.FAILSAFE} else Severity.NOTICE
        self._say(code, severity, f"act: {what} ended, {text}")
        self._end_pointing()
        self.wake_at = now
        if not only_pointing or not self._options.follow_target:
            self._withdraw(now)

    def _withdraw(self, now: HostNs) -> None:
        self._permission.withdraw()
        self._end_pointing()
        self._track = None
        self.wake_at = now

    def _end_pointing(self) -> None:
        self._points = False
        self._out += self._gimbal.end(self._autopilot)

    def _started(self, text: str) -> None:
        self._say(NoticeCode.ACT_STARTED, Severity.NOTICE, text + "; STOP ends it")

    def _tell(self, what: str, text: str | None) -> None:
        """Say a state when it begins; its end is not said."""
        if text is not None and self._told.get(what) != text:
            self._say(NoticeCode.ACT_WITHHELD, Severity.NOTICE, text)
        self._told[what] = text

    def _say(self, code: NoticeCode, severity: Severity, text: str) -> None:
        self._notices.append(Notice(code, severity, text, to_ground=True))

    def _next(self, now: HostNs) -> HostNs | None:
        if self._permission.selector is None:
            asks_at = self._gimbal.wake_at
            return None if asks_at is None else max(asks_at, HostNs(now + TICK_NS))
        due = [HostNs(now + (POINTING_NS if self._gimbal.control is Control.OURS else TICK_NS))]
        if self._permission.wake_at is not None:
            due.append(self._permission.wake_at)
        return max(min(due), HostNs(now + 1000))


def _name(track: Track) -> str:
    return f"{track.label or 'target'} {track.id}"
