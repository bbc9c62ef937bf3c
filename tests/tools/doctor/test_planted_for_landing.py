"""Settings that spoil a landing, here and in the autopilot: each is named with what was heard."""

import msgspec
import pytest
from hearing import found, heard

from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.types import ElevatedTarget, Pad, PadTag
from fwav_companion.types.flight_status import LandingReport
from sitl_mock import scenario

HEALTHY = scenario("unbiased").but({"seed": 3})
LANDING = ["publish.landing_target=true", "publish.landing_label=target", 'target=[{label = "target"}]']
SPOILT = HEALTHY.but(
    {
        "autopilot.precland_enabled": False,
        "autopilot.precland_yaw_align_cdeg": 9000.0,
        "autopilot.precland_orient": 0,
        "autopilot.precland_camera_m": (0.1, 0.0, 0.0),
        "autopilot.precland_offset_cm": (10.0, -5.0),
    }
)
"""Every parameter of the landing is wrong: one flight shows that all are requested and read."""
PARAMETERS = [
    ("PLND_ENABLED", "landing_disabled", Level.ERROR, "PLND_ENABLED is 0"),
    ("PLND_YAW_ALIGN", "landing_turned", Level.ERROR, "PLND_YAW_ALIGN = 9000 (by 90 deg)"),
    ("PLND_ORIENT", "landing_turned", Level.ERROR, "PLND_ORIENT = 0"),
    ("PLND_CAM_POS_", "landing_camera_offset", Level.WARNING, "(0.1, 0, 0) m"),
    (
        *("PLND_LAND_OFS_", "landing_offset", Level.NOTE),
        "the point 0.10 m behind and 0.05 m right of it lands on the target",
    ),
]


@pytest.mark.parametrize(("name", "code", "level", "said"), PARAMETERS, ids=[name for name, *_ in PARAMETERS])
def test_a_parameter_that_spoils_the_landing_is_named_where_we_steer_it(name, code, level, said):
    evidence = heard(SPOILT)
    assert found(evidence) == [], "LANDING_TARGET is off"
    spoilt, healthy = evidence.status.parameters, heard(HEALTHY).status.parameters
    alone = {key: (spoilt if key.startswith(name) else healthy)[key] for key in spoilt}
    assert alone != healthy
    (finding,) = examine(steered(evidence, alone))
    assert (finding.code, finding.level) == (code, level)
    assert said in finding.problem


def steered(evidence, parameters):
    """The evidence of a service that steers the landing of an autopilot with these parameters."""
    publish = msgspec.structs.replace(evidence.config.publish, landing_target=True, landing_label="target")
    status = msgspec.structs.replace(evidence.status, parameters=parameters)
    config = msgspec.structs.replace(evidence.config, publish=publish, target=(ElevatedTarget(label="target"),))
    return msgspec.structs.replace(evidence, config=config, status=status)


def test_a_whole_turn_of_our_vector_is_none():
    evidence = heard(HEALTHY)
    turned = {**evidence.status.parameters, "PLND_YAW_ALIGN": 36000.0}
    assert examine(steered(evidence, turned)) == []


def test_px4_has_none_of_these_parameters():
    assert found(heard(scenario("px4").but({"seed": 3}), LANDING)) == []


def test_a_landing_label_that_never_comes_is_named_with_what_came():
    (finding,) = examine(heard(HEALTHY, [LANDING[0], "publish.landing_label=pad"]))
    assert (finding.code, finding.level) == ("landing_label", Level.WARNING)
    assert '"pad"' in finding.problem
    assert '"target" (' in finding.problem


def test_landing_label_of_a_pad_comes_with_the_pads_tags():
    evidence = heard(HEALTHY, [LANDING[0], "publish.landing_label=pad"])
    pad = Pad(label="pad", tags=(PadTag(label="target", size_m=0.2),))
    config = msgspec.structs.replace(evidence.config, pad=(pad,))
    assert examine(msgspec.structs.replace(evidence, config=config)) == []


def test_a_landing_label_is_only_noted_while_nothing_at_all_is_seen():
    empty = {"camera.missed": 1.0, "camera.clutter": 0.0}
    (finding,) = examine(heard(HEALTHY.but(empty), LANDING))
    assert (finding.code, finding.level) == ("landing_label", Level.NOTE)


def test_a_landing_label_that_our_own_filter_removes_is_an_error():
    (finding,) = examine(heard(HEALTHY, [LANDING[0], "publish.landing_label=pad", 'detections.labels=["target"]']))
    assert (finding.code, finding.level) == ("landing_label", Level.ERROR)


def withheld(evidence, **counts):
    """The evidence of a service whose landing target was withheld for these reasons."""
    landing = LandingReport(target=3, sent=40, sigma_m=0.62, withheld=counts)
    publishing = msgspec.structs.replace(evidence.status.publishing, landing=landing)
    return msgspec.structs.replace(evidence, status=msgspec.structs.replace(evidence.status, publishing=publishing))


def test_landing_target_that_is_withheld_is_named_with_the_counts_of_each_reason():
    evidence = steered(heard(HEALTHY), heard(HEALTHY).status.parameters)
    assert found(withheld(evidence, no_target=900, late_frame=2)) == []
    (finding,) = examine(withheld(evidence, no_target=900, late_frame=3, too_uncertain=70))
    assert (finding.code, finding.level) == ("landing_withheld", Level.WARNING)
    assert "73 times, sent 40 times: too_uncertain 70, late_frame 3" in finding.problem
    assert "0.62 m, limit 0.5" in finding.problem
    assert "landing_max_sigma_m" in finding.fix


def test_landing_frames_that_come_late_are_used_and_named_since_their_stamps_may_be_wrong():
    landing = [LANDING[0], LANDING[1], "publish.landing_max_sigma_m=5"]
    late = heard(HEALTHY, landing, frame=lambda frame: frame | {"time_monotonic": frame["time_monotonic"] - 1.0})
    finding = next(each for each in examine(late) if each.code == "landing_camera_late")
    assert finding.level is Level.WARNING
    assert "1.0 s after their stamps" in finding.problem
    assert late.status.fixes > 100
    assert "too_late" not in late.status.dropped
    assert "landing_camera_late" not in found(heard(HEALTHY, landing))


def test_landing_label_without_pad_or_target_is_noted_as_flat_on_the_ground():
    evidence = steered(heard(HEALTHY), heard(HEALTHY).status.parameters)
    assert "landing_flat" not in {finding.code for finding in examine(evidence)}
    bare = msgspec.structs.replace(evidence, config=msgspec.structs.replace(evidence.config, target=()))
    (finding,) = [finding for finding in examine(bare) if finding.code == "landing_flat"]
    assert finding.level is Level.NOTE
    assert '"target" has neither' in finding.problem
