"""`check` reports no false alarm, one root cause for one fault, and nothing that it heard too little of."""

import re

import msgspec
import pytest
from configured_links import AUTOPILOT
from hearing import TEXT, Hearing, codes, consequences, evidence_of, flown, found, heard
from mavlink_wire import Wire
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.config import parse
from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.tools.doctor.report_text import report_lines
from fwav_companion.tools.doctor.run_status import run_status
from fwav_companion.types import DeliveryReport
from fwav_companion.types.status import VisionReport
from sitl_mock import scenario, simulate

HEALTHY = scenario("unbiased").but({"seed": 3})
SERIAL = TEXT.replace("udpin://127.0.0.1:14540", "serial:///dev/ttyAMA0:921600")


def with_another_sender(text):
    """The evidence with 254/97 on the autopilot's link, of whose frames only every third arrives."""
    hearing, other = Hearing(text=text), Wire(254, 97)
    mock, sent = simulate(HEALTHY.but({"seconds": 13.0})), 0
    for now_ns, _ in mock.drive(hearing):
        while mock.flight_s(now_ns) * 30.0 > sent:
            sent += 1
            frame = other.heartbeat(kind=18, autopilot=8)
            if sent % 3 == 0:
                hearing.hear("autopilot", frame, now_ns)
    return evidence_of(hearing)


@pytest.mark.parametrize("text", [pytest.param(TEXT, marks=pytest.mark.slow), SERIAL], ids=["udp", "serial"])
def test_another_sender_whose_messages_are_forwarded_in_part_is_no_loss(text):
    evidence = with_another_sender(text)
    (other,) = [peer for peer in evidence.status.traffic[0].peers if peer.system == 254]
    assert other.loss > 0.5
    assert found(evidence) == []
    lines = list(report_lines(evidence, [], ""))
    assert not any("254/97" in line and "lost" in line for line in lines)


@pytest.mark.parametrize(("text", "judged"), [(TEXT, False), (SERIAL, True)], ids=["udp", "serial"])
def test_loss_of_the_autopilots_frames_beside_another_sender_is_judged_on_serial_alone(text, judged):
    evidence = with_another_sender(text)
    peers = [{"system": 1, "component": 1, "received": 900, "lost": 100}, {"system": 254, "component": 97}]
    status = msgspec.structs.replace(
        evidence.status, traffic=run_status({"traffic": [{"name": "autopilot", "bytes_in": 9, "peers": peers}]}).traffic
    )
    assert found(msgspec.structs.replace(evidence, status=status)) == (["loss"] if judged else [])


def test_noise_of_the_gyros_of_a_still_vehicle_is_not_motion():
    still = scenario("paper_static").but({"seed": 3, "autopilot.gyro_noise_deg_s": 0.1})
    evidence = heard(still)
    assert found(evidence) == []
    assert evidence.status.telemetry.motion_hz == 0.0


def test_a_clock_that_settles_with_a_small_sigma_is_well():
    evidence = heard(HEALTHY)
    clock = msgspec.structs.replace(evidence.status.clock, status="settling", sigma_s=0.35e-3)
    assert found(msgspec.structs.replace(evidence, status=msgspec.structs.replace(evidence.status, clock=clock))) == []


FIXES = {
    "udpin://127.0.0.1:14540": "this computer",
    "udpin://0.0.0.0:14540": "radio",
    "serial:///dev/x:57600": "baud",
}


@pytest.mark.parametrize("url", FIXES)
def test_the_fix_of_a_poor_clock_goes_by_the_kind_of_link(url):
    evidence = heard(HEALTHY)
    clock = msgspec.structs.replace(evidence.status.clock, sigma_s=0.02)
    evidence = msgspec.structs.replace(
        evidence,
        config=parse(TEXT.replace("udpin://127.0.0.1:14540", url), "flight.toml"),
        status=msgspec.structs.replace(evidence.status, clock=clock),
    )
    (finding,) = examine(evidence)
    assert finding.code == "clock_unsettled"
    assert FIXES[url] in finding.fix


@pytest.mark.parametrize(
    ("url", "why", "fix"),
    [
        ("udpin://10.99.99.99:14540", "Cannot assign requested address", "0.0.0.0"),
        ("udpin://0.0.0.0:80", "Permission denied", "1024"),
        ("tcpout://127.0.0.1:5760", "Connection refused", "the other end"),
    ],
)
def test_the_fix_of_a_link_that_does_not_open_goes_by_the_reason(url, why, fix):
    evidence = heard(HEALTHY)
    written = msgspec.to_builtins(evidence.status)
    written["links"]["autopilot"] = {"state": "down", "why": why}
    config = parse(TEXT.replace("udpin://127.0.0.1:14540", url), "flight.toml")
    findings = examine(msgspec.structs.replace(evidence, config=config, status=run_status(written)))
    (down,) = [finding for finding in findings if finding.code == "link_down"]
    assert fix in down.fix


@pytest.mark.parametrize("seconds", [0.05, 1.0, 2.5, 3.5, 3.6, 3.7, 4.0, 5.0])
def test_too_short_a_time_of_listening_judges_nothing(seconds):
    findings = examine(heard(HEALTHY, seconds=seconds))
    assert codes(findings) == ["too_short"]
    assert findings[0].level is Level.NOTE


def test_a_fault_that_a_short_time_does_show_is_named():
    assert "timesync_unanswered" in found(heard(HEALTHY.but({"autopilot.answers_timesync": False}), seconds=6.0))


def test_one_dead_autopilot_is_one_finding_with_its_consequences():
    dying = HEALTHY.but({"downlink.silences": ((10.0, 1e3),)})
    (finding,) = examine(heard(dying, seconds=40.0))
    assert (finding.code, finding.level) == ("autopilot_lost", Level.ERROR)
    assert {"no_attitude", "stale_attitude"} <= consequences(finding)
    text = list(report_lines(evidence_of(Hearing()), [finding], ""))
    assert len([line for line in text if re.match(r"\d\. ", line)]) == 1
    assert sum("follows: " in line for line in text) == len(consequences(finding))


def test_a_link_that_is_down_lists_what_the_vehicle_lacks():
    evidence = heard(HEALTHY)
    written = msgspec.to_builtins(evidence.status)
    written["links"]["autopilot"] = {"state": "down", "why": "Connection refused"}
    written |= {"clock": {"status": "unknown"}, "telemetry": {}, "origin": None, "autopilot_lost": True}
    (finding,) = examine(msgspec.structs.replace(evidence, status=run_status(written)))
    assert finding.code == "link_down"
    assert {"autopilot_lost", "no_attitude", "no_clock", "no_position"} <= consequences(finding)


def test_a_ground_link_that_is_down_explains_nothing_of_the_vehicle():
    evidence = heard(HEALTHY.but({"autopilot.answers_timesync": False}))
    written = msgspec.to_builtins(evidence.status)
    written["links"]["ground"] = {"state": "down", "why": "Connection refused"}
    findings = examine(msgspec.structs.replace(evidence, status=run_status(written)))
    assert set(codes(findings)) == {"link_down", "timesync_unanswered"}
    assert not any(finding.consequences for finding in findings)


def test_a_root_is_as_severe_as_what_follows_from_it():
    late = 0.0

    def queued(frame):
        nonlocal late
        late += 0.004
        return frame | {"time_monotonic": frame["time_monotonic"] - late}

    (finding,) = examine(heard(HEALTHY, frame=queued))
    assert (finding.code, finding.level) == ("stamps_grow_old", Level.ERROR)
    assert [(each.code, each.level) for each in finding.consequences] == [("too_late", Level.ERROR)]


# Signing: the mismatch is the cause, and the link is not blamed.

KEY = bytes(range(32))
WITH_KEY = TEXT + '[signing]\nkey_file = "signing.key"\n[state]\ndirectory = "/var/lib/x"\n'


def signed_by_the_autopilot(key):
    """Sign the autopilot's frames by pymavlink."""
    parser, signer = dialect.MAVLink(None), dialect.MAVLink(None)
    signer.signing.secret_key, signer.signing.sign_outgoing = key, True
    signer.signing.timestamp = 1

    def sign(data):
        frames = b""
        for message in parser.parse_buffer(data) or []:
            signer.srcSystem, signer.srcComponent = message.get_srcSystem(), message.get_srcComponent()
            signer.seq = message.get_seq()
            frames += bytes(message.pack(signer))
        return frames

    return sign


def test_an_autopilot_with_a_key_that_we_lack_is_not_blamed_on_the_wire():
    streams = {"autopilot.rates_hz": {"ATTITUDE": 4.0, "GLOBAL_POSITION_INT": 4.0}}
    (finding,) = examine(heard(HEALTHY.but(streams), on_the_way_in=signed_by_the_autopilot(KEY), ignored=True))
    assert finding.code == "no_signing_key"
    assert {"timesync_unanswered", "rates_not_taken"} <= consequences(finding)


@pytest.mark.parametrize(
    ("sign", "code"),
    [(lambda data: data, "unsigned"), (signed_by_the_autopilot(bytes(32)), "wrong_signature")],
    ids=["no key there", "another key there"],
)
def test_frames_that_are_not_believed_are_one_finding(sign, code):
    (finding,) = [
        each
        for each in examine(heard(HEALTHY, text=WITH_KEY, key=KEY, on_the_way_in=sign, ignored=True))
        if each.code != "no_state"
    ]
    assert (finding.code, finding.level) == (code, Level.ERROR)
    assert not finding.consequences


@pytest.mark.slow
def test_a_reboot_is_shown_for_a_minute_and_then_forgotten():
    rebooting = HEALTHY.but({"others.reboots_at_s": (4.0,), "camera.enabled": False})
    text = AUTOPILOT + '[detections]\nurl = ""\n'
    early, late = (evidence_of(flown(rebooting, text=text, seconds=seconds)) for seconds in (12.0, 82.0))
    assert any("reboot" in line for line in report_lines(early, [], ""))
    assert not any("reboot" in line for line in report_lines(late, [], ""))
    assert not any("undone" in line for line in report_lines(early, [], ""))


def test_what_the_camera_really_delivers_is_reported():
    delivery = DeliveryReport(
        size=(640, 480), fps=29.97, exposure_s=0.002, clock="sensor", age_s=0.041, detector_hz=12.5, skipped=7
    )
    hearing = Hearing()
    evidence = evidence_of(hearing)
    status = msgspec.structs.replace(evidence.status, vision=VisionReport(works=True, delivery=delivery))
    lines = list(report_lines(msgspec.structs.replace(evidence, status=status), [], ""))
    assert (
        "pictures: 640 x 480, 30.0 Hz, exposure 2.00 ms; stamps by sensor, 41 ms old on arrival; "
        "the detector can process 12.5 Hz, 7 skipped"
    ) in lines
