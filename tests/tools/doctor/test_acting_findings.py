"""What `check` says about [act] and the gimbal, from the status of a running service."""

from types import SimpleNamespace

import pytest
from configured_links import AUTOPILOT
from flying import CAMERA

from fwav_companion.acting.options import ActTable
from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.tools.doctor.acting_findings import acting_findings
from fwav_companion.tools.doctor.gathering import quiet
from fwav_companion.tools.doctor.mount_findings import gimbal_findings
from fwav_companion.types.flight_status import ActingReport, GimbalReport

HELD = {
    "manager": "1/1",
    "pitch_limits_deg": (-90.0, 30.0),
    "yaw_limits_deg": (-180.0, 180.0),
    "primary": "0/0",
}


def evidence(device_id=154, **act):
    config = SimpleNamespace(
        act=ActTable(**act),
        localizes=True,
        camera=SimpleNamespace(mount=SimpleNamespace(gimbal_device_id=device_id)),
    )
    return SimpleNamespace(config=config, files=SimpleNamespace(calibration=object()))


def status(acting=None, *, kind="ardupilot", parameters=None, gimbal=None, unused=None):
    return SimpleNamespace(
        acting=acting,
        autopilot=SimpleNamespace(kind=kind),
        parameters=parameters or {},
        telemetry=SimpleNamespace(gimbal=gimbal, gimbal_unused=unused),
    )


def codes(found):
    return [finding.code for finding in found]


@pytest.mark.parametrize(
    ("device_id", "acting", "expected"),
    [
        (154, None, []),
        (154, ActingReport(point="roi"), ["act_roi"]),
        (154, ActingReport(point="gimbal"), ["act_no_manager"]),
        (154, ActingReport(point="gimbal", **HELD), ["act_gimbal"]),
        (1, ActingReport(point="gimbal", **HELD), ["act_gimbal", "act_stick_unseen"]),
    ],
)
def test_what_would_be_commanded_is_said(device_id, acting, expected):
    assert codes(acting_findings(evidence(device_id), status(acting))) == expected


def test_what_the_gimbal_can_do_is_said_with_its_limits():
    (finding,) = acting_findings(evidence(), status(ActingReport(point="gimbal", **HELD)))
    assert "from -90 to 30 deg in pitch, from -180 to 180 in yaw" in finding.problem
    assert "controlled by no program" in finding.problem


@pytest.mark.parametrize(
    ("system", "kind", "parameters", "heard", "expected"),
    [
        (0, "ardupilot", {}, False, ["follow_own_system"]),
        (0, "px4", {}, False, []),
        (17, "ardupilot", {"FOLL_SYSID": 17.0}, False, []),
        (17, "ardupilot", {"FOLL_SYSID": 0.0}, False, ["follow_other_system"]),
        (17, "ardupilot", {}, True, ["follow_id_heard"]),
    ],
)
def test_follow_target_that_the_autopilot_does_not_hear_is_said(system, kind, parameters, heard, expected):
    acting = ActingReport(follow_target=True, follow_id_heard=heard)
    found = acting_findings(evidence(follow_system_id=system), status(acting, kind=kind, parameters=parameters))
    assert codes(found) == expected


@pytest.mark.parametrize(
    ("gimbal", "unused", "expected"),
    [
        (None, None, []),
        (None, 154, ["gimbal_unused"]),
        (GimbalReport(age_s=0.1, levelled=True), None, []),
        (GimbalReport(age_s=0.1, levelled=None), None, ["gimbal_horizon"]),
        (GimbalReport(age_s=0.1, levelled=True, heading_off_deg=70.0), None, ["gimbal_heading"]),
        (GimbalReport(refused=9, refused_as="gimbal_setpoint"), None, ["gimbal_refused"]),
    ],
)
def test_trouble_of_the_gimbal_is_said(gimbal, unused, expected):
    assert codes(gimbal_findings(evidence(), status(gimbal=gimbal, unused=unused))) == expected


@pytest.mark.parametrize("act", ['point = "roi"', "follow_target = true"])
def test_check_that_listens_alone_has_what_it_reports_about_acting(act):
    text = AUTOPILOT + '[camera]\ncalibration = "camera.yaml"\n[act]\n' + act + "\n"
    calibration = parse_calibration(CAMERA, "camera.yaml")
    pipeline = make_pipeline(quiet(parse(text, "a.toml")), calibration, unix_offset_ns=0, live=True, written=True)
    reported = pipeline.status(HostNs(0)).acting
    assert (reported.point == "roi", reported.follow_target) == ("roi" in act, "follow" in act)
