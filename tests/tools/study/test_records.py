"""The record of a flight, its file, and the journal of a study that was interrupted."""

import json
import math

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest
from study_plans import InlineWorkers, fly, make_plan

from fwav_companion.errors import InputFileError
from fwav_companion.recording.error_statistics import CHI2_999
from fwav_companion.tools.study.conclusions import answer_of
from fwav_companion.tools.study.engine import earlier_records
from fwav_companion.tools.study.flight_draw import draw_flight
from fwav_companion.tools.study.flight_record import POINTS, FlightRecord
from fwav_companion.tools.study.keys import parse_variation
from fwav_companion.tools.study.record_file import (
    FILE,
    FlightJournal,
    ordered,
    read_journal,
    read_records,
    write_records,
)
from fwav_companion.tools.study.study_flight import record_of
from fwav_companion.tools.study.study_page import study_page

PLAN = make_plan(
    variations=(parse_variation("flight.height_m=10:20"), parse_variation("tracking.filter=kalman,lowpass"))
)


def made(index: int, arm: str = "configured", **values) -> FlightRecord:
    """A record without a flight."""
    common = {"varied": {"flight.height_m": 10.0 + index, "tracking.filter": "kalman"}, "flown": {}, "drawn": {}}
    chosen = {"state": "found", "no_answer": "", "error_m": 1.0 + index} | values
    return FlightRecord(index=index, arm=arm, **common, **chosen)


@pytest.fixture(scope="module")
def flown():
    plan = make_plan(seconds=12.0)
    drawn = draw_flight(plan, 0)
    return plan, drawn, fly(drawn.request)


def test_a_flight_gives_the_same_record_each_time(flown):
    plan, drawn, flight = flown
    assert msgspec.json.encode(record_of(drawn, plan, flight)) == msgspec.json.encode(record_of(drawn, plan, flight))


def test_the_record_has_the_truth_and_the_claim_of_the_flight(flown):
    plan, drawn, flight = flown
    record = record_of(drawn, plan, flight)
    assert record.state == "found"
    assert record.error_m == pytest.approx(math.hypot(record.north_error_m, record.east_error_m))
    assert record.errors_m[-1] == pytest.approx(record.error_m, abs=0.2)
    assert len(record.errors_m) == len(record.claims95_m) == len(record.squares) == POINTS
    assert record.errors_m[0] is None  # within the first 0.4 s nothing is confirmed
    assert record.drawn["mount_x_deg"] == flight.biases["mount_deg"][0]
    assert 0 < record.in_view <= record.frames
    # With a position of 1 m nothing else is as large; each share is below the claim itself.
    assert max(record.limits_m, key=record.limits_m.get) == "position"
    assert all(0.0 <= sigma_m < record.claimed95_m for sigma_m in record.limits_m.values())
    assert record.is_wrong == (record.normalised2 > CHI2_999)


def test_the_file_gives_back_what_was_written_in_the_order_of_index(tmp_path):
    records = [made(2), made(0, limits_m={"mount": 0.5}, errors_m=[None, 0.1]), made(1, "twice"), made(1)]
    write_records(tmp_path / FILE, records, PLAN, InlineWorkers.environment)
    found, plan, environment = read_records(tmp_path / FILE)
    assert found == ordered(records)
    assert [(record.index, record.arm) for record in found] == [(0, "configured"), (1, "configured"), (1, "twice"),
                                                               (2, "configured")]  # fmt: skip
    assert (plan, environment) == (PLAN, InlineWorkers.environment)
    columns = pq.read_table(tmp_path / FILE).to_pydict()
    assert columns["varied.tracking.filter"] == ["kalman"] * 4
    assert columns["limit_m.mount"] == [0.5, None, None, None]


def test_the_file_has_the_same_bytes_in_whatever_order_flights_finished(tmp_path):
    records = [made(index) for index in range(5)]
    for name, order in (("a", records), ("b", records[::-1])):
        write_records(tmp_path / name, order, PLAN, InlineWorkers.environment)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_the_file_has_no_host_and_no_time(tmp_path):
    write_records(tmp_path / FILE, [made(0)], PLAN, InlineWorkers.environment)
    schema = pq.read_schema(tmp_path / FILE)
    assert set(schema.metadata) == {b"fwav.plan", b"fwav.processors", b"fwav.wheels"}
    assert json.loads(schema.metadata[b"fwav.wheels"]) == {"numpy": "2"}
    assert not [name for name in schema.names if "hostname" in name or "unix" in name or "address" in name]


def test_report_of_a_studys_file_is_that_of_the_study_itself(flown, tmp_path):
    plan, drawn, flight = flown
    records = [record_of(drawn, plan, flight)]
    write_records(tmp_path / FILE, records, plan, InlineWorkers.environment)
    pages = [
        study_page(plan, each, answer_of(plan, each), InlineWorkers.environment)
        for each in (records, read_records(tmp_path / FILE)[0])
    ]
    assert pages[0] == pages[1]


def test_a_file_that_is_none_is_one_line(tmp_path):
    (tmp_path / FILE).write_bytes(b"PAR1 no")
    with pytest.raises(InputFileError, match="not readable") as raised:
        read_records(tmp_path / FILE)
    assert "\n" not in str(raised.value)


def test_a_journal_whose_last_line_was_cut_keeps_the_others(tmp_path):
    journal = FlightJournal(tmp_path, PLAN)
    for index in range(3):
        journal.add(made(index))
    journal.close(remove=False)
    data = journal.path.read_bytes()
    journal.path.write_bytes(data[:-40])
    assert [record.index for record in read_journal(tmp_path, PLAN)] == [0, 1]
    with pytest.raises(InputFileError, match="of another study"):
        read_journal(tmp_path, make_plan(seed=9))


def test_a_study_goes_on_only_with_the_same_options(tmp_path):
    write_records(tmp_path / FILE, [made(0), made(9)], PLAN, InlineWorkers.environment)
    assert [record.index for record in earlier_records(PLAN, tmp_path)] == [0]  # of 3 flights
    with pytest.raises(InputFileError, match=r"seed 1, not 2"):
        earlier_records(msgspec.structs.replace(PLAN, seed=2), tmp_path)


def test_a_record_survives_its_way_from_a_worker_exactly():
    record = made(0, error_m=0.1 + 0.2, errors_m=[None, float(np.nextafter(1.0, 2.0))])
    assert msgspec.json.decode(msgspec.json.encode(record), type=FlightRecord) == record


NESTED = b"[" * 200_000 + b"]" * 200_000
HOSTILE = {
    "nested": b'{"unknown": ' + NESTED + b"}",
    "list": NESTED,
    "no text": b'{"seed": "\xff\xfe"}',
    "no JSON": b"{",
    "another kind": b"7",
}


@pytest.mark.parametrize("key", [b"fwav.plan", b"fwav.processors", b"fwav.wheels"])
@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE)
def test_metadata_of_a_stranger_is_one_line(tmp_path, key, content):
    write_records(tmp_path / FILE, [made(0)], PLAN, InlineWorkers.environment)
    table = pq.read_table(tmp_path / FILE)
    pq.write_table(table.replace_schema_metadata({**table.schema.metadata, key: content}), tmp_path / FILE)
    with pytest.raises(InputFileError, match="not readable") as raised:
        read_records(tmp_path / FILE)
    assert "\n" not in str(raised.value)


def test_lines_of_a_stranger_in_the_journal_are_left_out(tmp_path):
    journal = FlightJournal(tmp_path, PLAN)
    journal.add(made(0))
    journal._file.write(b"\n".join(HOSTILE.values()) + b"\n")
    journal.add(made(1))
    journal.close(remove=False)
    assert [record.index for record in read_journal(tmp_path, PLAN)] == [0, 1]
