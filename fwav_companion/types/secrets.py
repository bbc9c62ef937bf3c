"""Texts of the configuration that may hold a password or a token, and the form in which the service writes them.

A field of such a type is redacted wherever a configuration leaves the service: recordings, logs, status, reports.
"""

from __future__ import annotations

import re
import typing
from collections.abc import Iterator
from typing import Annotated, Any, Final, TypeAlias

import msgspec
from msgspec import Meta

SECRET: Final = "secret"  # noqa: S105  # a key, not a password
SecretUrl: TypeAlias = Annotated[str, Meta(extra={SECRET: "url"})]
"""A URL whose user, password and query values are secret."""
SecretPath: TypeAlias = Annotated[str, Meta(extra={SECRET: "path"})]
"""HOST:PORT/TOKEN."""
REDACTED: Final = "redacted-redacted"
"""As long as a token must be: a configuration that was redacted is valid."""


def redacted_url(url: str) -> str:
    """The URL without its user, password and query values."""
    return re.sub(r"([?&][^=&#]*=)[^&#]+", rf"\1{REDACTED}", re.sub(r"(?<=//)[^/\s]+@", f"{REDACTED}@", url))


def redacted_path(address: str) -> str:
    """HOST:PORT/TOKEN without its token."""
    return re.sub(r"(?<=[0-9]/).+", REDACTED, address)


REDACTIONS: Final = {"url": redacted_url, "path": redacted_path}


def secrets_of(form: msgspec.Struct) -> Iterator[tuple[str, str]]:
    """(text, redacted text) of every field, at any depth, that has something to redact."""
    hints = typing.get_type_hints(type(form), include_extras=True)
    for name in form.__struct_fields__:
        kind = _kind(hints[name])
        for value in _leaves(getattr(form, name)):
            if isinstance(value, msgspec.Struct):
                yield from secrets_of(value)
            elif kind is not None and isinstance(value, str) and (hidden := REDACTIONS[kind](value)) != value:
                yield value, hidden


def redacted(tree: Any, secrets: dict[str, str]) -> Any:
    """The tree of builtins with every text that is one of ``secrets`` replaced by its redacted form."""
    if isinstance(tree, dict):
        return {key: redacted(value, secrets) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [redacted(value, secrets) for value in tree]
    return secrets.get(tree, tree) if isinstance(tree, str) else tree


def _leaves(value: object) -> Iterator[object]:
    if isinstance(value, list | tuple):
        for each in value:
            yield from _leaves(each)
    else:
        yield value


def _kind(hint: Any) -> str | None:
    """The kind of secret of a field's type, also of the elements of a tuple; None where it has none."""
    for meta in getattr(hint, "__metadata__", ()):
        if isinstance(meta, Meta) and meta.extra and SECRET in meta.extra:
            return str(meta.extra[SECRET])
    return next((kind for each in typing.get_args(hint) if (kind := _kind(each)) is not None), None)
