"""The protocol of an observer of a running service, for example that of ``check --shake``."""

from __future__ import annotations

from typing import Protocol

from fwav_companion.telemetry import Telemetry
from fwav_companion.types import Frame, Message, NoFrame
from fwav_companion.types.status import RunStatus


class Witness(Protocol):
    """Observer of a running service."""

    def on_frame(self, frame: Frame | NoFrame) -> None:
        """Called with each frame that arrived."""

    def on_message(self, message: Message) -> None:
        """Called with each message that arrived."""

    def enough(self, status: RunStatus, telemetry: Telemetry) -> bool:
        """Whether the service may stop; called a few times a second with the status and the vehicle."""
