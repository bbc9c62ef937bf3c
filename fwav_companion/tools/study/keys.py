"""KEY of --set and --vary: a key of the configuration or of the flight, for the truth, the claim, or both.

``KEY`` sets both, ``truth.KEY`` only the sigma or value by which a flight is drawn, ``claim.KEY`` only the
configuration with which it is replayed. PURE.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from difflib import get_close_matches
from random import Random
from typing import Final, TypeAlias

import msgspec

from fwav_companion.config.document import Document
from fwav_companion.config.key_errors import hints_of, shortened, table_of
from fwav_companion.errors import UserError

Value: TypeAlias = float | str

FLIGHT: Final = "flight."
TRUTH: Final = "truth."
CLAIM: Final = "claim."
FLIGHT_KEYS: Final = (
    "height_m", "radius_m", "speed_m_s", "pitch_deg", "flap_hz", "flap_deg", "wind_m_s", "miss_rate",
)  # fmt: skip
TABLES: Final = ("camera", "ground", "rates", "tracking", "uncertainty", "vehicle")
"""Tables that change a simulated flight or its replay."""
DRAWN_TABLES: Final = ("camera", "rates", "uncertainty", "vehicle")
"""Tables that state something about the flight itself."""
UNVARIED: Final = (
    "camera.calibration", "ground.terrain", "ground.terrain_datum", "ground.height_m", "vehicle.position",
    "vehicle.system_id", "vehicle.component_id",
)  # fmt: skip
LIMITS: Final = {
    "height_m": (0.5, 1000.0), "radius_m": (0.5, 2000.0), "speed_m_s": (0.1, 50.0), "pitch_deg": (-60.0, 60.0),
    "flap_hz": (0.1, 50.0), "flap_deg": (0.0, 30.0), "wind_m_s": (0.0, 25.0), "miss_rate": (0.0, 0.95),
}  # fmt: skip


class Variation(msgspec.Struct, frozen=True):
    """One --vary: a key with a range, drawn uniformly, or with choices, drawn equally often."""

    key: str
    low: float = 0.0
    high: float = 0.0
    choices: tuple[Value, ...] = ()

    @property
    def is_range(self) -> bool:
        """Whether the values are a range."""
        return not self.choices

    @property
    def examples(self) -> tuple[Value, ...]:
        """The ends of the range, or all choices."""
        return self.choices or (self.low, self.high)

    def drawn(self, rng: Random) -> Value:
        """A value."""
        return rng.choice(self.choices) if self.choices else rng.uniform(self.low, self.high)


def parse_setting(text: str) -> tuple[str, str]:
    """Key and value of a --set. UserError."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        raise UserError(f"--set: {shortened(text)}: accepted: KEY=VALUE, as uncertainty.mount_bias_deg=0.5")
    key = key.strip()
    require_key(key, "--set")
    if key.startswith(FLIGHT):
        _require_flight_value(key, _number(value, f"--set {text}"), "--set")
    return key, value.strip()


def parse_variation(text: str) -> Variation:
    """A --vary. UserError."""
    key, equals, values = text.partition("=")
    key, accepted = key.strip(), "accepted: KEY=LOW:HIGH or KEY=A,B,C, as flight.height_m=5:40"
    if not equals or not values.strip():
        raise UserError(f"--vary: {shortened(text)}: {accepted}")
    require_key(key, "--vary")
    if re.fullmatch(r"[^:,\"]+:[^:,\"]+", values):
        low, high = (_number(part, f"--vary {text}") for part in values.split(":"))
        if not low < high:
            raise UserError(f"--vary: {shortened(text)}: the low end is not below the high end; {accepted}")
        variation = Variation(key, low, high)
    else:
        variation = Variation(key, choices=tuple(_value(part.strip()) for part in values.split(",")))
        if len(variation.choices) < 2:
            raise UserError(f"--vary: {shortened(text)}: one value is no variation; {accepted}, or --set")
    if key.startswith(FLIGHT):
        for example in variation.examples:
            _require_flight_value(key, example, "--vary")
    return variation


def require_key(key: str, option: str) -> None:
    """UserError unless the key exists and changes a simulated flight; the nearest key is named."""
    if key.startswith(FLIGHT):
        name = key.removeprefix(FLIGHT)
        if name not in FLIGHT_KEYS:
            raise UserError(f"{option}: {key}: unknown key; {_nearest(name, FLIGHT_KEYS, FLIGHT)}")
        return
    bare = key.removeprefix(TRUTH).removeprefix(CLAIM)
    table, known = bare.partition(".")[0], known_keys()
    if bare not in known:
        others = [*(f"{FLIGHT}{name}" for name in FLIGHT_KEYS), *(each for each in known if each not in UNVARIED)]
        if table in hints_of(Document) and table not in TABLES:
            raise UserError(
                f"{option}: {key}: [{table}] does not change a flight; accepted tables: {', '.join(TABLES)}"
            )
        raise UserError(f"{option}: {key}: unknown key; {_nearest(bare, others, '')}")
    if bare in UNVARIED:
        raise UserError(f"{option}: {key}: a study cannot vary it; accepted: another key of [{table}]")
    if key.startswith(TRUTH) and table not in DRAWN_TABLES:
        raise UserError(
            f"{option}: {key}: [{table}] says how a flight is evaluated, there is no truth of it; accepted: {bare}"
        )


def known_keys() -> tuple[str, ...]:
    """Dotted keys of the tables that a study can set."""
    found: list[str] = []
    for table in TABLES:
        form = table_of(hints_of(Document)[table])
        for name, hint in hints_of(form).items() if form is not None else ():
            inner = table_of(hint)
            if inner is None:
                found.append(f"{table}.{name}")
            else:
                found += [f"{table}.{name}.{each}" for each in hints_of(inner)]
    return tuple(found)


def truth_settings(settings: Iterable[tuple[str, str]]) -> list[str]:
    """The ``KEY=VALUE`` of the configuration by which flights are drawn."""
    return _without_prefix(settings, CLAIM, TRUTH)


def claim_settings(settings: Iterable[tuple[str, str]]) -> list[str]:
    """The ``KEY=VALUE`` of the configuration with which flights are replayed."""
    return _without_prefix(settings, TRUTH, CLAIM)


def flight_settings(settings: Iterable[tuple[str, str]]) -> dict[str, float]:
    """The values of ``flight.`` keys by name."""
    return {key.removeprefix(FLIGHT): float(value) for key, value in settings if key.startswith(FLIGHT)}


def toml_text(value: Value) -> str:
    """A drawn value as a --set has it."""
    return repr(value) if isinstance(value, float) else value


def _without_prefix(settings: Iterable[tuple[str, str]], left_out: str, prefix: str) -> list[str]:
    return [f"{key.removeprefix(prefix)}={value}" for key, value in settings if not key.startswith((left_out, FLIGHT))]


def _nearest(name: str, known: Iterable[str], prefix: str) -> str:
    known = list(known)
    near = get_close_matches(name, known, n=1)
    if not near:  # the last part alone, as a user who forgot the table writes it
        near = [key for key in known if key.rpartition(".")[2] == name.rpartition(".")[2]][:1]
    if near:
        return f'did you mean "{prefix}{near[0]}"?'
    named = [prefix + key for key in known if prefix or key.startswith(FLIGHT)]
    tables = "" if prefix else f", or a key of [{'], ['.join(TABLES)}], as uncertainty.mount_bias_deg"
    return f"accepted: {', '.join(named)}{tables}"


def _require_flight_value(key: str, value: Value, option: str) -> None:
    low, high = LIMITS[key.removeprefix(FLIGHT)]
    if not isinstance(value, float) or not low <= value <= high:
        raise UserError(f"{option}: {key} = {shortened(value)}: accepted: a number from {low:g} to {high:g}")


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{where}: {shortened(text.strip())} is not a number; accepted: a number")
    return value


def _value(text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        return text
