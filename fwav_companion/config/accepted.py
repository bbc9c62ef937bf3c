"""What a key accepts, in words, from the type that the configuration declares for it."""

from __future__ import annotations

from typing import Any

from msgspec import inspect


def accepted_text(hint: Any) -> str:
    """As ``a number from 0 to 1``, ``"auto" | "none"``, ``a list of texts``."""
    return _text(inspect.type_info(hint))


def _text(kind: inspect.Type) -> str:
    match kind:
        case inspect.Metadata(type=inner, extra_json_schema=schema):
            return str((schema or {}).get("description", _text(inner)))
        case inspect.LiteralType(values=values):
            return " | ".join(f'"{value}"' for value in values)
        case inspect.UnionType(types=types):
            return " | ".join(_text(member) for member in types if not isinstance(member, inspect.NoneType))
        case inspect.FloatType() | inspect.IntType():
            return _number(kind)
        case inspect.BoolType():
            return "true | false"
        case inspect.StrType(min_length=shortest, max_length=longest):
            return (
                f"a text of {shortest} to {longest} characters"
                if longest
                else f"a {'' if not shortest else 'non-empty '}text"
            )
        case inspect.TupleType(item_types=items):
            return f"a list of {len(items)}: each {_text(items[0])}"
        case inspect.VarTupleType(item_type=item):
            return f"a list, each element {_text(item)}"
        case inspect.DictType(key_type=key, value_type=value):
            return f"a table, each key {_text(key)}, each value {_text(value)}"
        case _:
            return "a table"


def _number(kind: inspect.FloatType | inspect.IntType) -> str:
    noun = "an integer" if isinstance(kind, inspect.IntType) else "a number"
    if kind.ge is not None and kind.le is not None:
        return f"{noun} from {kind.ge:g} to {kind.le:g}"
    low = f"above {kind.gt:g}" if kind.gt is not None else f"{kind.ge:g} or more" if kind.ge is not None else ""
    high = f"at most {kind.le:g}" if kind.le is not None else ""
    limits = " and ".join(part for part in (low, high) if part)
    return f"{noun}, {limits}" if limits else noun
