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

_ANSWERS: Final = frozenset({BY_NAME["COMMAND_ACK"].msgid})
"""Messages that name their receiver but request nothing of it: accepted unsigned where telemetry is."""


class SigningPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """Signing configuration: every frame of ours is signed with the key, and only signed frames are read."""

    key: bytes
    """Signing key, 32 bytes."""
    timestamp: int
    """First timestamp, from :func:`~fwav_companion.mavlink.wire.signing.starting_timestamp`."""
    accept_unsigned: frozenset[str] = frozenset()
    """Links on which unsigned telemetry is read as well; a request to us never is."""


class Trust(Enum):
    """Trust level of a frame."""

    NONE = "none"
    UNSIGNED = "unsigned"
    SIGNED = "signed"
    """Its signature was verified."""


class Keyring:
    """Signs our frames and judges received ones with the key, if there is one. Only reading needs it; forwarding does
    not.
    """

    def __init__(self, policy: SigningPolicy | None) -> None:
        self.clock = SigningClock(policy.timestamp) if policy else None
        self._policy = policy
        self._verifier = Verifier(policy.key, self.clock) if policy and self.clock else None

    def signer(self, port: Port) -> Signer | None:
        """Return the signer of one link, which has a link id of its own; None without a key."""
        return Signer(self._policy.key, port.index & 0xFF, self.clock) if self._policy and self.clock else None

    def judge(self, port: Port, frame: RawFrame, now: HostNs) -> Trust:
        """Return the trust level of a frame of a known id that is addressed to us or to all."""
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
        """Return whether an unsigned frame is accepted. Radio reports are: a radio cannot sign. Requests to us never
        are.
        """
        if frame.msgid in RADIO_REPORTS:
            return True
        asks = frame.definition is None or frame.definition.target_system_offset >= 0
        telemetry = not asks or frame.msgid in _ANSWERS
        return telemetry and self._policy is not None and port.name in self._policy.accept_unsigned
