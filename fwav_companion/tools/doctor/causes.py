"""Which findings follow from which: a root cause lists its consequences, so that the user repairs one thing.

CAUSES is acyclic and ordered from the wire to the target. Findings of one link explain only those of the same link, and
those of the vehicle where no other link brings its autopilot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import msgspec

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level, by_level, worst

SLOW: Final = frozenset(
    {
        *("attitude_slow", "too_slow_for_motion", "stale_attitude", "attitude_gap", "direction_uncertain"),
        *("above_horizon", "fixes_disagree"),
    }
)
"""Findings about attitudes that come too seldom or too late, and about the fixes that they spoil."""
OF_MOUNTS: Final = frozenset({"above_horizon", "fixes_disagree"})
"""Findings that, as an ERROR, are caused by the mount, however slow attitudes are."""
CLOCK: Final = frozenset({"no_clock", "timesync_unanswered", "clock_followed", "clock_unsettled", "long_round_trip"})
BY_CLOCK: Final = frozenset({"from_the_future", "too_late", "direction_uncertain"})
"""Findings about frames whose stamps use an uncertain clock."""
UNHEARD: Final = frozenset(
    {"no_autopilot", "autopilot_lost", "no_attitude", "no_position", "landmark_without_sights", *CLOCK, *SLOW}
)
"""Findings that follow where the vehicle's link is not heard."""
UNDELIVERED: Final = frozenset({"no_attitude", "rates_undone", "rates_not_taken", *CLOCK, *SLOW})
"""Findings that follow while the autopilot ignores this service."""
UNSEEN: Final = frozenset(
    {"no_camera", "vision_stopped", "no_detections", "stale_detections", "landing_label", "landmark_unseen"}
)
UNUSED: Final = frozenset({"landing_label", "landmark_unseen", "fixes_disagree"})

CAUSES: Final[Mapping[str, frozenset[str]]] = {
    "port_missing": UNHEARD | {"link_down", "nothing_heard"},
    "port_permission": UNHEARD | {"link_down", "nothing_heard"},
    "serial_console": UNHEARD | {"link_down", "port_taken", "nothing_heard", "garbage", "echo", "loss"},
    "bluetooth_on_port": UNHEARD | {"link_down", "port_taken", "nothing_heard", "garbage", "loss"},
    "mini_uart": UNHEARD | {"garbage", "loss"},
    "port_taken": UNHEARD,
    "link_down": UNHEARD,
    "nothing_heard": UNHEARD,
    "garbage": UNHEARD | {"loss"},
    "wrong_signature": UNHEARD | UNDELIVERED,
    "unsigned": UNHEARD | UNDELIVERED,
    "outdated_signatures": UNHEARD | UNDELIVERED,
    "no_signing_key": UNDELIVERED,
    "loss": SLOW | CLOCK,
    "autopilot_lost": UNHEARD - {"no_autopilot", "autopilot_lost"} | {"rates_undone", "rates_not_taken"},
    "no_attitude": frozenset({"stale_attitude", "attitude_gap"}),
    "loop_rate": SLOW,
    "rates_undone": SLOW,
    "rates_not_taken": SLOW | {"timesync_unanswered"},
    "attitude_slow": SLOW - {"attitude_slow"},
    "too_slow_for_motion": OF_MOUNTS,
    "timesync_unanswered": BY_CLOCK,
    "clock_followed": BY_CLOCK,
    "clock_unsettled": BY_CLOCK,
    "calibration": UNSEEN,
    "model": UNSEEN,
    "camera_missing": UNSEEN,
    "camera_permission": UNSEEN,
    "vision_stopped": UNSEEN - {"vision_stopped"},
    "no_camera": UNSEEN - {"no_camera", "vision_stopped"},
    "detections_port": UNSEEN,
    "no_detections": frozenset({"landing_label", "landmark_unseen"}),
    "stale_detections": frozenset({"landing_label", "landmark_unseen"}),
    "disk_full": frozenset({"recording_stopped"}),
    "read_only": frozenset({"recording_stopped"}),
    "landmark_far": frozenset(
        {"landmark_unseen", "landmark_without_sights", "landmark_left_out", "landmarks_contradict"}
    ),
    "malformed": UNUSED,
    "no_time": UNUSED,
    "stamps_drift": frozenset({"too_late", "from_the_future", "fixes_disagree"}),
    "stamps_grow_old": frozenset({"too_late", "fixes_disagree"}),
    "stamps_jump": frozenset({"too_late", "from_the_future", "fixes_disagree", "readout_unknown"}),
    "stamps_repeat": frozenset({"too_late", "fixes_disagree", "readout_unknown"}),
    "mount_in_radians": frozenset({"above_horizon", "fixes_disagree"}),
    "above_horizon": frozenset({"fixes_disagree"}),
}
"""Codes of the consequences of each finding, by its code."""


def nested(findings: Sequence[Finding], evidence: Evidence) -> list[Finding]:
    """Return the root findings, the worst first, each with its consequences; a root is as severe as they are."""
    cause_of = [_cause(effect, findings, evidence) for effect in findings]

    def with_consequences(index: int) -> Finding:
        own = findings[index]
        effects = by_level(with_consequences(k) for k, cause in enumerate(cause_of) if cause == index)
        return msgspec.structs.replace(own, level=worst([own, *effects]), consequences=tuple(effects))

    return by_level(with_consequences(index) for index, cause in enumerate(cause_of) if cause is None)


def _cause(effect: Finding, findings: Sequence[Finding], evidence: Evidence) -> int | None:
    """Return the index of the first finding that explains another; None for a root."""
    for index, cause in enumerate(findings):
        if effect.code in CAUSES.get(cause.code, ()) and _reaches(cause, effect, evidence):
            return index
    return None


def _reaches(cause: Finding, effect: Finding, evidence: Evidence) -> bool:
    if effect.code in OF_MOUNTS and effect.level is Level.ERROR:
        return cause.code in OF_MOUNTS or cause.code == "mount_in_radians"
    if not cause.where.startswith("link "):
        return True
    if effect.where.startswith("link "):
        return effect.where == cause.where
    return cause.where == _only_way(evidence)


def _only_way(evidence: Evidence) -> str:
    """Return the link that the autopilot is heard on, or the only one that it could be heard on; "" if neither is."""
    autopilot = evidence.status.autopilot if evidence.status is not None else None
    if autopilot is not None and autopilot.link:
        return f"link {autopilot.link}"
    ways = [link.name for link in evidence.config.link if link.role == "autopilot"]
    return f"link {ways[0]}" if len(ways) == 1 else ""
