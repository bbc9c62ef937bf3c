"""Faults of landmarks, each planted in the configuration or the status of a healthy service."""

import msgspec
import pytest
from hearing import codes, heard
from test_planted_in_the_status import HEALTHY, altered, planted_in

from fwav_companion.config.estimation import LandmarkConfig
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.tools.doctor.landmark_findings import FRAMES
from fwav_companion.types import Pad

LABEL = "tag36h11:0"


@pytest.fixture(scope="module")
def healthy():
    return heard(HEALTHY)


def findings(evidence, report, *, north_deg=0.0, labels=(), seen=100, filter_name="kalman"):
    """What `check` says with one landmark ``north_deg`` north of the origin, seen in ``seen`` frames."""
    origin, config = evidence.status.origin, evidence.config
    landmark = LandmarkConfig(
        label=LABEL, lat=origin.lat + north_deg, lon=origin.lon, alt_amsl=origin.alt_amsl, sigma_m=0.05
    )
    config = msgspec.structs.replace(
        config,
        landmark=(landmark,),
        detections=msgspec.structs.replace(config.detections, labels=labels),
        tracking=msgspec.structs.replace(config.tracking, filter=filter_name),
    )
    status = msgspec.to_builtins(evidence.status)
    status = altered(status, ["sight", "landmarks"], [{"label": LABEL, **report}])
    status = altered(status, ["sight", "heard", "labels"], {"target": 300} | ({LABEL: seen} if seen else {}))
    return planted_in(msgspec.structs.replace(evidence, config=config), status)


USED = {"state": "used", "used": 90}


def test_a_landmark_that_is_used_is_no_finding(healthy):
    assert findings(healthy, USED) == []


@pytest.mark.parametrize(
    ("code", "level", "report", "how"),
    [
        ("landmark_unseen", Level.NOTE, {}, {"seen": 0}),
        ("landmark_left_out", Level.WARNING, {"state": "left_out", "used": 20, "refused": 9, "off_m": 1.84}, {}),
        ("landmarks_contradict", Level.WARNING, {"state": "used", "used": 90, "contradicts": ["second"]}, {}),
        ("landmark_without_sights", Level.WARNING, {}, {}),
        ("landmark_filtered", Level.WARNING, {}, {"labels": ("target",)}),
        ("landmark_far", Level.WARNING, {}, {"seen": 0, "north_deg": 1.0}),
        ("landmarks_not_applied", Level.WARNING, {"state": "not_applied"}, {"filter_name": "lowpass"}),
    ],
)
def test_what_is_wrong_with_a_landmark_is_named(healthy, code, level, report, how):
    (finding,) = findings(healthy, report, **how)
    assert (finding.code, finding.level) == (code, level)
    assert "landmark" in finding.where
    assert finding.problem
    assert finding.fix


def test_a_landmark_that_is_left_out_is_named_with_its_distance(healthy):
    (finding,) = findings(healthy, {"state": "left_out", "refused": 9, "off_m": 1.84})
    assert LABEL in finding.where
    assert "1.8 m" in finding.problem


@pytest.mark.parametrize(("state", "use"), [("used", "wider claims"), ("left_out", "left out")])
def test_a_contradiction_names_the_others_and_what_is_done(healthy, state, use):
    (finding,) = findings(healthy, {"state": state, "used": 90, "contradicts": ["second", "third"]})
    assert finding.code == "landmarks_contradict"
    assert "second, third" in finding.problem
    assert use in finding.problem


def test_ten_kilometres_and_twenty_frames_are_the_bounds(healthy):
    assert findings(healthy, USED, north_deg=0.0899) == []  # 9.995 km
    assert codes(findings(healthy, USED, north_deg=0.0901)) == ["landmark_far"]
    assert findings(healthy, {}, seen=FRAMES - 1) == []
    assert codes(findings(healthy, {}, seen=FRAMES)) == ["landmark_without_sights"]


def test_the_filter_that_uses_no_landmark_is_named(healthy):
    (finding,) = findings(healthy, {"state": "not_applied"}, filter_name="lowpass")
    assert "lowpass" in finding.problem


def test_the_label_that_moves_is_named_where_landmarks_are_not_used(healthy):
    config = msgspec.structs.replace(healthy.config, pad=(Pad(label="boat", tags=(), motion="moving"),))
    (finding,) = findings(msgspec.structs.replace(healthy, config=config), {"state": "not_applied"})
    assert 'motion = "moving" of boat' in finding.problem
    assert 'motion = "static"' not in finding.problem
