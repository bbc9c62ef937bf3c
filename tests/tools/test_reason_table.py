"""The table of reasons: complete, and what its readers need."""

import pytest

from fwav_companion.tools.reason_table import REASONS, judged_reasons, reasons_of, words_of
from fwav_companion.types import Reason

TRACKS = {
    "never_confirmed",
    "not_seen",
    "not_seen_long",
    "origin_set",
    "replaced",
    "too_many_tracks",
    "vehicle_changed",
}


def test_every_reason_has_one_table_and_no_table_is_of_another_name():
    assert set(REASONS) == set(Reason)


def test_reasons_of_tracks_are_not_words_of_the_report_and_all_others_are():
    assert set(reasons_of("track")) == TRACKS
    assert {reason.value for reason, entry in REASONS.items() if not entry.words} == TRACKS


@pytest.mark.parametrize("reason", Reason)
def test_reason_that_check_judges_has_a_problem_and_every_reason_a_meaning_and_a_remedy(reason):
    entry = REASONS[reason]
    assert entry.meaning.endswith((".", ".]"))
    assert entry.remedy
    assert bool(entry.problem) == (entry.level is not None)
    assert entry.level is None or reason in judged_reasons(entry.of)


def test_reason_of_a_later_version_has_no_words():
    assert words_of("of_tomorrow") == ""
