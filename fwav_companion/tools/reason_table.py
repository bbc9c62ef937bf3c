"""The table of reasons, ``reasons.toml``, for report, `check` and reference page: what each means and what to do."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Final, Literal

import msgspec

from fwav_companion.types import Reason


class ReasonEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One reason; the head of the file explains the fields."""

    of: Literal["frame", "detection", "track"]
    meaning: str
    words: str = ""
    remedy: str
    level: Literal["ERROR", "WARNING"] | None = None
    problem: str = ""
    consequences: tuple[str, ...] = ()


def _read() -> Mapping[Reason, ReasonEntry]:
    text = files(__package__).joinpath("reasons.toml").read_text(encoding="utf-8")
    return msgspec.convert(tomllib.loads(text), dict[Reason, ReasonEntry])


REASONS: Final = _read()
"""Every reason, in the order of the findings."""


def words_of(reason: str) -> str:
    """The reason in words; "" for one that this version does not know."""
    return REASONS[Reason(reason)].words if reason in REASONS else ""


def reasons_of(things: Literal["frame", "detection", "track"]) -> list[Reason]:
    """The reasons for which whole frames, single detections, or tracks are refused."""
    return [reason for reason, entry in REASONS.items() if entry.of == things]


def judged_reasons(things: Literal["frame", "detection"]) -> list[Reason]:
    """Those of which `check` has a finding."""
    return [reason for reason in reasons_of(things) if REASONS[reason].level is not None]
