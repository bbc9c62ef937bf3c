"""Lines of the target log, and the lines that are not made without a reader."""

import pytest

from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.types import Reason


def filled(ledger):
    ledger.keep_sightings(1000, 1, [{"type": "sighting"}])
    ledger.write({"type": "clock"})
    ledger.drop(Reason.NO_CLOCK)
    ledger.begin(None)
    ledger.write({"type": "home"})
    return [line["type"] for line in ledger.take()]


@pytest.mark.parametrize(("written", "lines"), [(True, ["header", "clock", "home"]), (False, ["header"])])
def test_lines_are_kept_for_who_takes_them_and_counts_always(written, lines):
    ledger = TargetLog("1.0", {}, 0, written=written)
    assert filled(ledger) == lines
    assert ledger.counts()["dropped"] == {"no_clock": 1}
