"""An XML schema of the public rules of Cursor on Target, checked by libxml2."""

from __future__ import annotations

from datetime import datetime
from functools import cache
from pathlib import Path

from lxml import etree


@cache
def schema() -> etree.XMLSchema:
    """The schema of one event."""
    return etree.XMLSchema(file=str(Path(__file__).with_name("cot_event.xsd")))


def complaints(event: bytes) -> list[str]:
    """What is wrong with an event: by the schema, and that it is stale before it begins."""
    root = etree.fromstring(event)
    schema().validate(root)
    found = [error.message for error in schema().error_log]
    if not found:
        start, stale = (datetime.fromisoformat(root.get(name)) for name in ("start", "stale"))
        if stale < start:
            found.append("stale before its start")
    return found
