"""Notices of landmarks: one in use, one that is left out, and several that contradict one another."""

import pytest

from fwav_companion.pipeline.landmark_notices import LandmarkNotices, landmark_reports
from fwav_companion.types import LandmarkRecord, LandmarkState, NoticeCode

USED, LEFT_OUT = LandmarkState.USED, LandmarkState.LEFT_OUT


def records(state, contradicts):
    return [
        LandmarkRecord("mark", state, used=9, contradicts=("second",) if contradicts else ()),
        LandmarkRecord("second", state, used=9, contradicts=("mark",) if contradicts else ()),
    ]


@pytest.mark.parametrize("state", [USED, LEFT_OUT])
def test_a_contradiction_is_reported_once_to_the_ground_and_accuses_no_landmark(state):
    notices = LandmarkNotices()
    assert [each.code for each in notices.notices(records(USED, False))] == [NoticeCode.LANDMARK_USED] * 2
    (notice,) = notices.notices(records(state, True))
    assert notice.code is NoticeCode.LANDMARKS_CONTRADICT
    assert notice.to_ground
    assert "mark, second" in notice.text
    assert not notices.notices(records(state, True))


def test_one_that_is_left_out_later_is_named():
    notices = LandmarkNotices()
    notices.notices(records(USED, True))
    later = [records(USED, False)[0], LandmarkRecord("second", LEFT_OUT, used=9, off_m=1.0)]
    assert [each.code for each in notices.notices(later)] == [NoticeCode.LANDMARK_USED, NoticeCode.LANDMARK_LEFT_OUT]


def test_the_status_has_the_contradiction():
    assert [each.contradicts for each in landmark_reports(records(USED, True))] == [("second",), ("mark",)]
