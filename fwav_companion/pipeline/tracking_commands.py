"""Passes commands to the camera, and the operator's selections to what acts on them. Pure."""

from __future__ import annotations

from typing import Final

import msgspec

from fwav_companion.acting.acting import Acting
from fwav_companion.publishing.enums import (
    MAV_CMD_CAMERA_STOP_TRACKING,
    MAV_CMD_CAMERA_TRACK_POINT,
    MAV_CMD_CAMERA_TRACK_RECTANGLE,
)
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types.commands import Command, CommandAnswer, CommandResult
from fwav_companion.types.situation import Situation

SELECTIONS: Final = frozenset({MAV_CMD_CAMERA_TRACK_POINT, MAV_CMD_CAMERA_TRACK_RECTANGLE})
TRACKING: Final = SELECTIONS | {MAV_CMD_CAMERA_STOP_TRACKING}


class TrackingCommands:
    """Handlers of the camera's component and of the companion's, which answers tracking commands too: what an autopilot
    forwards comes to an onboard controller.
    """

    def __init__(self, publisher: Publisher, acting: Acting | None, camera_component: int) -> None:
        """``acting``: None where [act] is absent."""
        self._publisher, self._acting, self._camera_component = publisher, acting, camera_component

    def on_camera(self, command: Command, situation: Situation) -> CommandAnswer | None:
        """Answer to a command to the camera; None where it is unknown."""
        answer = self._publisher.on_command(command, situation)
        if answer is not None and answer.result is CommandResult.ACCEPTED and self._acting is not None:
            if command.number in SELECTIONS:
                self._acting.on_selected(command, self._publisher.clicked, situation.autopilot, situation.now_ns)
            elif command.number == MAV_CMD_CAMERA_STOP_TRACKING:
                self._acting.on_stopped(situation.now_ns)
        return answer

    def on_companion(self, command: Command, situation: Situation) -> CommandAnswer | None:
        """Answer to a tracking command to the companion; None for others, and for one to all components, which the
        camera answers: it gets one answer.
        """
        if command.number not in TRACKING or command.broadcast:
            return None
        return self.on_camera(msgspec.structs.replace(command, to_component=self._camera_component), situation)
