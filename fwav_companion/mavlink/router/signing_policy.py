"""What may be believed: with a key, signed frames, and unsigned telemetry where the configuration says so."""

from __future__ import annotations

from enum import Enum
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.routing import RADIO_REPORTS, Port
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.signing import Signature, Signer, SigningClock, Verifier

_ANSWERS: Final = frozenset({BY_NAME["COMMAND_ACK"].msgid})
"""Messages that name their receiver and yet ask nothing of it: taken unsigned where telemetry is."""


class SigningPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """With a key, every frame of ours is signed, and of others' only signed ones are read."""

    key: bytes
    """32 bytes."""
    timestamp: int
    """To begin with, from :func:`~fwav_companion.mavlink.wire.signing.starting_timestamp`."""
    accept_unsigned: frozenset[str] = frozenset()
    """Links by which unsigned telemetry is read all the same; never what asks something of us."""


class Trust(Enum):
    """How far a frame is believed."""

    NONE = "none"
    UNSIGNED = "unsigned"
    SIGNED = "signed"
    """Its signature was verified."""


class Keyring:
    """The key, if there is one: signs what leaves and judges what comes. Reading only: forwarding asks nobody."""

    def __init__(self, policy: SigningPolicy | None) -> None:
        self.clock = SigningClock(policy.timestamp) if policy else None
        self._policy = policy
        self._verifier = Verifier(policy.key, self.clock) if policy and self.clock else None

    def signer(self, port: Port) -> Signer | None:
        """For one link, under a link id of its own; None without a key."""
        return Signer(self._policy.key, port.index & 0xFF, self.clock) if self._policy and self.clock else None

    def judge(self, port: Port, frame: RawFrame, now: HostNs) -> Trust:
        """A frame of a known id that is meant for us or for all."""
        if self._verifier is None:
            port.signed_unverified += frame.signed
            return Trust.UNSIGNED
        if frame.signed:
            verdict = self._verifier.verify(frame.data, frame.system, frame.component, now)
            if verdict is Signature.GENUINE:
                return Trust.SIGNED
            port.refused_signatures += 1
            return Trust.NONE
        if self._accepts_unsigned(port, frame):
            return Trust.UNSIGNED
        port.refused_unsigned += 1
        return Trust.NONE

    def _accepts_unsigned(self, port: Port, frame: RawFrame) -> bool:
        """A radio cannot sign. What asks something of us must be signed, by whatever link it comes."""
        if frame.msgid in RADIO_REPORTS:
            return True
        asks = frame.definition is None or frame.definition.target_system_offset >= 0
        telemetry = not asks or frame.msgid in _ANSWERS
        return telemetry and self._policy is not None and port.name in self._policy.accept_unsigned
