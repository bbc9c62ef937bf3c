"""Lines of the target log, and the lines that are not made without a reader."""

import pytest

from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.types import Reason


def filled(target_log):
    target_log.keep_sightings(1000, 1, [{"type": "sighting"}])
    target_log.write({"type": "clock"})
    target_log.drop_frames(Reason.NO_CLOCK)
    target_log.begin(None)
    target_log.write({"type": "home"})
    return [line["type"] for line in target_log.take()]


@pytest.mark.parametrize(("written", "lines"), [(True, ["header", "clock", "home"]), (False, ["header"])])
def test_lines_are_kept_for_who_takes_them_and_counts_always(written, lines):
    target_log = TargetLog("1.0", {}, 0, written=written)
    assert filled(target_log) == lines
    assert target_log.counts()["dropped"] == {"no_clock": 1}
