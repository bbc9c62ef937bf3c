"""SHELL: the file of a study: Parquet, one row a flight, in the order of index; and the journal while it grows.

Columns: those of :class:`FlightRecord`, with ``varied.KEY``, ``flown.NAME``, ``drawn.NAME`` and ``limit_m.CAUSE`` for
its mappings. The file's metadata has the plan, the processors and the wheels of the workers; neither times nor names
of hosts are in it, so that the same study gives the same bytes on any number of equal workers.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import open_regular, whole
from fwav_companion.tools.study.flight_record import CAUSE_NAMES, DRAWN, FLOWN, FlightRecord
from fwav_companion.tools.study.study_plan import StudyPlan

FILE: Final = "study.parquet"
JOURNAL: Final = "study.journal.jsonl"
"""Finished flights of a study that was not finished; it is removed with the last one."""
PLAN, PROCESSORS, WHEELS = b"fwav.plan", b"fwav.processors", b"fwav.wheels"
PLAIN: Final = (
    ("index", pa.int64()),
    ("arm", pa.string()),
    ("state", pa.string()),
    ("no_answer", pa.string()),
    ("error_m", pa.float64()),
    ("north_error_m", pa.float64()),
    ("east_error_m", pa.float64()),
    ("claimed95_m", pa.float64()),
    ("normalised2", pa.float64()),
    ("calibrated_s", pa.float64()),
    ("calibration", pa.string()),
    ("calibration_lacks", pa.string()),
    ("ghosts", pa.int64()),
    ("frames", pa.int64()),
    ("in_view", pa.int64()),
    ("fixes", pa.int64()),
    ("errors_m", pa.list_(pa.float64())),
    ("claims95_m", pa.list_(pa.float64())),
    ("squares", pa.list_(pa.float64())),
)
NESTED: Final = (("flown", FLOWN), ("drawn", DRAWN), ("limit_m", CAUSE_NAMES))
FIELD_OF: Final = {"limit_m": "limits_m"}
"""Fields whose columns have another name."""


class Environment(msgspec.Struct, frozen=True):
    """The inputs that, together with the plan, determine the bytes of a study's file."""

    processors: tuple[str, ...]
    """Models of the workers' processors, each once."""
    wheels: dict[str, str]
    """Versions of the libraries that compute."""


def ordered(records: Iterable[FlightRecord]) -> list[FlightRecord]:
    """The records by index, then by arm."""
    return sorted(records, key=lambda record: (record.index, record.arm))


def write_records(path: Path, records: Sequence[FlightRecord], plan: StudyPlan, environment: Environment) -> None:
    """Write the file whole. OSError."""
    table = _table(ordered(records), plan)
    metadata = {
        PLAN: msgspec.json.encode(plan),
        PROCESSORS: json.dumps(sorted(environment.processors)).encode(),
        WHEELS: json.dumps(dict(sorted(environment.wheels.items()))).encode(),
    }
    with whole(path) as file:
        pq.write_table(table.replace_schema_metadata(metadata), file, compression="zstd")


def read_records(path: Path) -> tuple[list[FlightRecord], StudyPlan, Environment]:
    """The content of a file. InputFileError."""
    accepted = "accepted: study.parquet, as `study` writes it"
    try:
        with open_regular(path) as file:
            table = pq.read_table(file)
        metadata = table.schema.metadata or {}
        plan = msgspec.json.decode(metadata[PLAN], type=StudyPlan)
        processors = msgspec.json.decode(metadata[PROCESSORS], type=tuple[str, ...])
        wheels = msgspec.json.decode(metadata[WHEELS], type=dict[str, str])
        environment = Environment(processors, wheels)
        return [_record(row, plan) for row in table.to_pylist()], plan, environment
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror or error}; {accepted}") from None
    except (pa.ArrowException, msgspec.DecodeError, KeyError, ValueError, OverflowError, RecursionError) as error:
        raise InputFileError(f"{path}: not readable ({' '.join(str(error).split())[:120]}); {accepted}") from None


class FlightJournal:
    """Finished flights, appended one by one, so that they survive an interruption of the study."""

    def __init__(self, folder: Path, plan: StudyPlan) -> None:
        """Continue the journal in the folder. OSError."""
        self.path = folder / JOURNAL
        is_new = not self.path.exists()
        self._file = self.path.open("ab", buffering=0)
        if is_new:
            self._file.write(plan.digest.encode() + b"\n")

    def add(self, record: FlightRecord) -> None:
        """Append a record. OSError."""
        line = memoryview(msgspec.json.encode(record) + b"\n")
        while line:
            line = line[self._file.write(line) :]

    def close(self, *, remove: bool) -> None:
        """Close the file; ``remove``: its flights are in the Parquet file."""
        self._file.close()
        if remove:
            self.path.unlink(missing_ok=True)


def read_journal(folder: Path, plan: StudyPlan) -> list[FlightRecord]:
    """The flights in the folder's journal; a last line that a crash cut off is left out. InputFileError."""
    path = folder / JOURNAL
    try:
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return []
    if lines[0].decode(errors="replace") != plan.digest:
        raise InputFileError(f"{path}: of another study; accepted: the same options as before, or another --out")
    found = []
    for line in lines[1:]:
        try:
            found.append(msgspec.json.decode(line, type=FlightRecord))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            continue
    return found


def _table(records: Sequence[FlightRecord], plan: StudyPlan) -> pa.Table:
    columns: dict[str, pa.Array] = {
        name: pa.array([getattr(record, name) for record in records], kind) for name, kind in PLAIN
    }
    for variation in plan.variations:
        key, kind = variation.key, pa.float64() if _is_number(variation.examples) else pa.string()
        values = [record.varied[key] for record in records]
        columns[f"varied.{key}"] = pa.array(values if kind == pa.float64() else map(str, values), kind)
    for field, names in NESTED:
        for name in names:
            values = [getattr(record, FIELD_OF.get(field, field)).get(name) for record in records]
            columns[f"{field}.{name}"] = pa.array(values, pa.float64())
    return pa.table(columns)


def _is_number(values: Iterable[Any]) -> bool:
    return all(isinstance(value, float) for value in values)


def _record(row: dict[str, Any], plan: StudyPlan) -> FlightRecord:
    nested: dict[str, dict[str, Any]] = {
        FIELD_OF.get(field, field): {
            name: row[f"{field}.{name}"] for name in names if row[f"{field}.{name}"] is not None
        }
        for field, names in NESTED
    }
    varied = {each.key: row[f"varied.{each.key}"] for each in plan.variations}
    plain = {name: row[name] for name, _ in PLAIN}
    return msgspec.convert({**plain, **nested, "varied": varied}, FlightRecord)
