"""Every configuration key with its default and accepted values, and the rules between keys."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from frozen import hold
from msgspec import inspect

from fwav_companion.__main__ import main
from fwav_companion.config import Config

OURS = {"file", "stated_sigmas"}
"""Fields of the typed value that are not keys: the path of the file itself, and which of its keys have numbers."""


def limits(kind: Any) -> str:
    """The accepted values in words, as ``number >= 0 <= 1``, ``list of text``, ``"auto" | "none"``."""
    match kind:
        case inspect.Metadata(type=inner):
            return limits(inner)
        case inspect.LiteralType(values=values):
            return " | ".join(f'"{value}"' for value in values)
        case inspect.UnionType(types=types):
            return " | ".join(limits(each) for each in types if not isinstance(each, inspect.NoneType))
        case inspect.FloatType() | inspect.IntType():
            bounds = {">": kind.gt, ">=": kind.ge, "<": kind.lt, "<=": kind.le}
            noun = "integer" if isinstance(kind, inspect.IntType) else "number"
            return " ".join([noun, *(f"{sign} {bound:g}" for sign, bound in bounds.items() if bound is not None)])
        case inspect.BoolType():
            return "true | false"
        case inspect.StrType(min_length=shortest, max_length=longest, pattern=pattern):
            length = f" {shortest or 0}..{longest or ''} characters" if shortest or longest else ""
            return f"text{length}{f' matching {pattern}' if pattern else ''}"
        case inspect.TupleType(item_types=items):
            return f"{len(items)} of {limits(items[0])}"
        case inspect.VarTupleType(item_type=item):
            return f"list of {limits(item)}"
        case inspect.DictType(key_type=key, value_type=value):
            return f"table of {limits(key)} to {limits(value)}"
    raise AssertionError(f"no word for {kind}")


def inner_table(kind: Any) -> tuple[Any, str]:
    """(struct of a table, an optional table or a list of tables, suffix of its name); (None, "") for a plain key."""
    match kind:
        case inspect.Metadata(type=inner):
            return inner_table(inner)
        case inspect.StructType():
            return kind, ""
        case inspect.UnionType(types=types):
            return next((found for found in map(inner_table, types) if found[0]), (None, ""))
        case inspect.VarTupleType(item_type=item):
            return inner_table(item)[0], "[]"
    return None, ""


def facts_of(kind: Any, path: str) -> Iterator[str]:
    for field in kind.fields:
        name = f"{path}.{field.encode_name}" if path else field.encode_name
        if name in OURS:
            continue
        table, suffix = inner_table(field.type)
        if table is not None:
            yield f"[{name}{suffix}]{'' if suffix or field.default is not None else ' may be absent'}"
            yield from facts_of(table, name + suffix)
            continue
        default = field.default if field.default is not msgspec.NODEFAULT else None
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        shown = "required" if field.required else f"default {msgspec.json.encode(default).decode()}"
        yield f"{name}: {limits(field.type)}; {shown}"


def test_every_key_with_its_default_and_what_it_accepts():
    hold("configuration", facts_of(inspect.type_info(Config), ""))


def test_the_file_of_init_has_every_key_and_only_those(tmp_path):
    """Keys in comments count, because users uncomment them."""
    assert main(["init", str(tmp_path)]) == 0
    text = (tmp_path / "fwav-companion.toml").read_text()
    shown = tomllib.loads(re.sub(r"^# (?=(\[+\w+\]+|\w+ = ))", "", text, flags=re.MULTILINE))
    facts = set()

    def walk(value: Any, path: str) -> None:
        for key, inner in value.items():
            name = f"{path}.{key}" if path else key
            if isinstance(inner, dict) and name != "link[].max_rate_hz":
                walk(inner, name)
            elif isinstance(inner, list) and inner and isinstance(inner[0], dict):
                for each in inner:
                    walk(each, f"{name}[]")
            else:
                facts.add(name)

    walk(shown, "")
    hold("configuration_shown", facts)


LINK = '[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:14540"\nrole = "autopilot"\n'
RELAY = LINK + '[detections]\nurl = ""\n'
MARK = '[[landmark]]\nlabel = "a"\nlat = 48.0\nlon = 11.0\nalt_amsl = 500.0\n'
RULES = {
    "no link": ('[detections]\nurl = ""\n', "link"),
    "no autopilot link": (RELAY.replace('"autopilot"', '"gcs"'), "role"),
    "two links of one name": (LINK + RELAY, "name"),
    "an unsigned link that does not exist": (RELAY + '[signing]\naccept_unsigned = ["b"]\n', "accept_unsigned"),
    "a key file that does not exist": (RELAY + '[signing]\nkey_file = "absent.key"\n', "absent.key"),
    "detections without a calibration": (LINK, "calibration"),
    "a calibration that does not exist": (LINK + '[camera]\ncalibration = "absent.yaml"\n', "absent.yaml"),
    "terrain without a datum": (RELAY + '[ground]\nterrain = ["a.hgt"]\n', "terrain_datum"),
    "landing without a label": (RELAY + "[publish]\nlanding_target = true\n", "landing_label"),
    "landing on a click": (RELAY + '[publish]\nlanding_target = true\nlanding_label = "click"\n', "landing_label"),
    "the camera component's own id": (RELAY + "[vehicle]\ncomponent_id = 100\n", "component_id"),
    "two landmarks of one label": (RELAY + 2 * MARK, "label"),
    "a landmark that is a target": (RELAY + MARK + '[[target]]\nlabel = "a"\nheight_m = 1.0\n', "[[target]]"),
    "a landmark beyond the pole": (RELAY + MARK.replace("48.0", "98.0"), "lat"),
    "a landmark without an altitude": (RELAY + MARK.replace("alt_amsl = 500.0\n", ""), "alt_amsl"),
    "a gimbal and a mount that looks down": (RELAY + "[camera.mount]\ngimbal_device_id = 1\n", "pitch_deg"),
}
"""Broken rules: the configuration, and the text that the error must contain."""


@pytest.mark.parametrize("rule", RULES)
def test_a_broken_rule_is_one_line_and_exit_2(rule, tmp_path, capsys):
    text, named = RULES[rule]
    path = tmp_path / "flight.toml"
    path.write_text(text)
    assert main(["run", "--config", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "flight.toml" in error
    assert named in error
