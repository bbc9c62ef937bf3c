#!/usr/bin/env python3
"""Writes the pages of docs/reference/ that follow from the code: commands, keys, reasons, notices, findings, scenarios.

``.venv/bin/python docs/make_reference.py`` writes them; a test fails where a committed page differs from the code.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import redirect_stdout, suppress
from inspect import getsource
from pathlib import Path
from string import Formatter
from typing import Any, Final, Literal, TypeVar

import msgspec
from msgspec import inspect

from fwav_companion.cli.main import COMMANDS, main
from fwav_companion.config import Config
from fwav_companion.tools.doctor.finding_table import FINDINGS, SHARED_PARTS, FindingEntry, Template
from fwav_companion.tools.reason_table import REASONS, judged_reasons
from fwav_companion.types import NoticeCode, Reason
from sitl_mock.autopilots import AUTOPILOTS
from sitl_mock.scenarios import SCENARIOS

T = TypeVar("T")
THINGS: Final[tuple[Literal["frame", "detection"], ...]] = ("frame", "detection")
FOLDER: Final = Path(__file__).parent / "reference"
HELP_COLUMNS: Final = "100"
"""Width at which argparse wraps its help."""
GENERATED: Final = "<!-- Written by docs/make_reference.py. Change the code, not this page. -->\n\n"


def pages() -> Mapping[str, str]:
    """Each page's text by its file name."""
    texts = {
        "commands.md": commands_page(),
        "configuration.md": configuration_page(),
        "reasons.md": reasons_page(),
        "notices.md": notices_page(),
        "findings.md": findings_page(),
        "scenarios.md": scenarios_page(),
    }
    return {name: GENERATED + text for name, text in texts.items()}


def commands_page() -> str:
    """Every command with its ``--help``."""
    intro = (
        "# Commands\n\nExit status: 0 done; 1 the command ran and the result is bad; 2 wrong usage, configuration or "
        "input file.\n"
    )
    sections = [f"## {command.name}\n\n```text\n{help_of(command.name)}```\n" for command in COMMANDS]
    return "\n".join([intro, *sections])


def help_of(command: str) -> str:
    """What ``fwav-companion COMMAND --help`` prints, at a fixed width."""
    printed = io.StringIO()
    columns = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = HELP_COLUMNS
    try:
        with redirect_stdout(printed), suppress(SystemExit):
            main([command, "--help"])
    finally:
        os.environ.pop("COLUMNS")
        if columns is not None:
            os.environ["COLUMNS"] = columns
    return printed.getvalue()


def configuration_page() -> str:
    """Every table and key: what it accepts, its default, its meaning."""
    intro = (
        "# Configuration\n\nA TOML file; `fwav-companion init` writes one with every key. Unknown "
        "keys are errors that suggest the nearest known one. Paths are relative to the file.\n"
    )
    return "\n".join([intro, *tables(Config, "")])


def tables(kind: type, path: str) -> Iterator[str]:
    """The section of each table within the Struct ``kind``, in the file's order."""
    meanings = meanings_of(kind)
    for field in msgspec.structs.fields(kind):
        inner, is_list = struct_in(inspect.type_info(field.type))
        if inner is None or field.encode_name == "file":
            continue
        name = f"{path}{field.encode_name}"
        heading = f"[[{name}]]" if is_list else f"[{name}]"
        yield f"## {heading}\n\n{meanings.get(field.name, '')}\n"
        yield table(inner)
        yield from tables(inner, f"{name}.")


def table(kind: type) -> str:
    """The keys of one table, a row each; empty where it has tables alone."""
    meanings = meanings_of(kind)
    rows = [
        row(f"`{field.encode_name}`", accepted(inspect.type_info(field.type)), default_of(field), meanings[field.name])
        for field in msgspec.structs.fields(kind)
        if struct_in(inspect.type_info(field.type))[0] is None
    ]
    return "\n".join(["| key | accepts | default | meaning |", "|---|---|---|---|", *rows, ""]) if rows else ""


def struct_in(kind: Any) -> tuple[type | None, bool]:
    """(Struct of a table, whether it is a list of tables); (None, False) for a plain key."""
    match kind:
        case inspect.Metadata(type=inner):
            return struct_in(inner)
        case inspect.StructType(cls=found):
            return found, False
        case inspect.UnionType(types=types):
            return next((found for found in map(struct_in, types) if found[0]), (None, False))
        case inspect.VarTupleType(item_type=item):
            found, _ = struct_in(item)
            return found, found is not None
    return None, False


def accepted(kind: Any) -> str:
    """The accepted values in words."""
    match kind:
        case inspect.Metadata(type=inner):
            return accepted(inner)
        case inspect.LiteralType(values=values):
            return ", ".join(f'`"{value}"`' for value in values)
        case inspect.UnionType(types=types):
            return " or ".join(accepted(each) for each in types if not isinstance(each, inspect.NoneType))
        case inspect.FloatType() | inspect.IntType():
            bounds = {"above": kind.gt, "at least": kind.ge, "below": kind.lt, "at most": kind.le}
            noun = "integer" if isinstance(kind, inspect.IntType) else "number"
            return ", ".join([noun, *(f"{word} {bound:g}" for word, bound in bounds.items() if bound is not None)])
        case inspect.BoolType():
            return "`true`, `false`"
        case inspect.StrType():
            return "text"
        case inspect.TupleType(item_types=items):
            return f"{len(items)} of {accepted(items[0])}"
        case inspect.VarTupleType(item_type=item):
            return f"list of {accepted(item)}"
        case inspect.DictType(key_type=key, value_type=value):
            return f"table of {accepted(key)} to {accepted(value)}"
    raise AssertionError(f"no word for {kind}")


def default_of(field: msgspec.structs.FieldInfo) -> str:
    """The default as TOML shows it; "required" without one."""
    if field.required:
        return "required"
    value = field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory()
    return "absent" if value is None else f"`{json.dumps(msgspec.to_builtins(value))}`"


def meanings_of(kind: type) -> dict[str, str]:
    """The docstring below each attribute, of the class and those that it derives from."""
    meanings: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if base.__module__.startswith("fwav_companion"):
            meanings |= attribute_docstrings(getsource(base))
    return meanings


def attribute_docstrings(source: str) -> dict[str, str]:
    """The docstring below each attribute of the first class in ``source``; "" below an attribute without one."""
    (body,) = [node.body for node in ast.parse(source).body if isinstance(node, ast.ClassDef)][:1]
    meanings: dict[str, str] = {}
    for index, node in enumerate(body):
        names = (
            [node.target] if isinstance(node, ast.AnnAssign) else node.targets if isinstance(node, ast.Assign) else []
        )
        after = body[index + 1] if index + 1 < len(body) else None
        text = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
        meanings |= {name.id: " ".join(str(text).split()) for name in names if isinstance(name, ast.Name)}
    return meanings


def reasons_page() -> str:
    """Every reason for which a frame, a detection or a track gives no result, with what to do."""
    intro = (
        "# Reasons\n\nEvery frame, detection and track without a result has one of these reasons. Each is "
        "counted under its name in `dropped` of the status file and of a replay's summary.\n"
    )
    rows = [row(f"`{reason.value}`", REASONS[reason].meaning, REASONS[reason].remedy) for reason in Reason]
    return "\n".join([intro, "| reason | meaning | what to do |", "|---|---|---|", *rows, ""])


def notices_page() -> str:
    """Every notice of the log and of ground stations."""
    intro = (
        "# Notices\n\nThe service reports each event once, in its log and, where an operator needs it, as "
        "STATUSTEXT. The code is stable; the wording may change.\n"
    )
    meanings = attribute_docstrings(getsource(NoticeCode))
    rows = [row(f"`{code.value}`", meanings[code.name]) for code in NoticeCode]
    return "\n".join([intro, "| notice | meaning |", "|---|---|", *rows, ""])


def findings_page() -> str:
    """Every finding of ``check``: its level, an example of its problem, and what it says to do."""
    intro = (
        "# Findings\n\nWhat `fwav-companion check` reports. ERROR: the service does not do its work; WARNING: it "
        "works less well than it could; NOTE: worth knowing. `…` is a value of the moment.\n"
    )
    rows = [finding_row(code, entry) for code, entry in FINDINGS.items()]
    rows += [judged_row(reason, things) for things in THINGS for reason in judged_reasons(things)]
    return "\n".join([intro, "| finding | level | problem | what to do |", "|---|---|---|---|", *sorted(rows), ""])


def scenarios_page() -> str:
    """The scenarios of the mock autopilot."""
    rows = [row(f"`{name}`", text) for name, (text, _) in SCENARIOS.items()]
    intro = (
        "# Scenarios of the mock\n\n"
        "`sitl-mock --scenario NAME` flies one, `--record DIR` writes it to files at once, `--set KEY=VALUE` changes\n"
        "an option. The seed (`--seed`) decides every error. What one names but does not show is as in `default`.\n"
    )
    autopilots = [row(f"`{name}`", text) for name, (text, _) in AUTOPILOTS.items()]
    others = (
        "## Other autopilots\n\n"
        "`sitl-mock --autopilot NAME` replaces the scenario's autopilot; the flight stays. In a second terminal\n"
        "`fwav-companion run` and then `check` show what the service does with it.\n"
    )
    scenarios = [intro, "| scenario | flight |", "|---|---|", *rows, ""]
    return "\n".join([*scenarios, others, "| autopilot | behaviour |", "|---|---|", *autopilots, ""])


def finding_row(code: str, entry: FindingEntry) -> str:
    """The row of a finding of the table."""
    levels = " or ".join(level.value for level in cases_of(entry.level))
    return row(f"`{code}`", levels, words_of(entry.problem, entry), words_of(entry.fix, entry))


def judged_row(reason: Reason, things: str) -> str:
    """The row of a finding about refused frames or detections: of the reason's level where it costs most of them."""
    entry = REASONS[reason]
    levels = "WARNING" if entry.level == "WARNING" else f"{entry.level} or WARNING"
    return row(f"`{reason.value}`", levels, f"… of … {things}s {entry.problem}", entry.remedy)


def words_of(template: Template, entry: FindingEntry) -> str:
    """A text of a finding in every case, with its parts, and with … for a value of the moment."""
    parts = SHARED_PARTS | entry.parts
    texts = (
        "".join(
            before + ("" if name is None else words_of_part(parts[name], entry) if name in parts else "…")
            for before, name, _, _ in Formatter().parse(each)
        )
        for each in cases_of(template)
    )
    return " / ".join(filter(None, texts))


def words_of_part(part: Template, entry: FindingEntry) -> str:
    """A part within a text: in brackets where it has several cases."""
    words = words_of(part, entry)
    return f"({words})" if isinstance(part, dict) and " / " in words else words


def cases_of(field: T | dict[str, T]) -> list[T]:
    """What a field of a finding is in every case, each once."""
    return list(dict.fromkeys(field.values())) if isinstance(field, dict) else [field]


def row(*cells: str) -> str:
    """A row of a Markdown table; code marks of reStructuredText become those of Markdown."""
    return "| " + " | ".join(cell.replace("``", "`").replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def stale(folder: Path = FOLDER) -> list[str]:
    """Names of pages that differ from the code."""
    return [
        name for name, text in pages().items() if not (folder / name).exists() or (folder / name).read_text() != text
    ]


def write(folder: Path, texts: Mapping[str, str]) -> Iterable[Path]:
    """Write the pages; yields the path of each."""
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text)
        yield folder / name


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    for path in write(FOLDER, pages()):
        sys.stdout.write(f"{path}\n")
