"""Faults that a running service reports of itself and its parts, each planted in the status of a healthy one."""

from collections.abc import Mapping
from itertools import product

import msgspec
import pytest
from hearing import CAMERA, TEXT, codes, evidence_of, flown, found, heard, silent

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.tools.doctor.evidence import Folder
from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.tools.doctor.report_text import report_lines
from fwav_companion.tools.doctor.run_status import UNJUDGED, run_status
from fwav_companion.types import Reason
from sitl_mock import scenario

HEALTHY = scenario("unbiased").but({"seed": 3})


@pytest.fixture(scope="module")
def hearing():
    return flown(HEALTHY)


@pytest.fixture(scope="module")
def healthy(hearing):
    evidence = evidence_of(hearing)
    assert found(evidence) == []
    return evidence


@pytest.fixture(scope="module")
def written(hearing):
    """The status as the service writes it."""
    return hearing.status()


def altered(status, path, value):
    """A copy of the status with another value at that path."""
    key, *rest = path
    inside = status.get(key) if isinstance(status.get(key), Mapping) else {}
    return {**status, key: altered(inside, rest, value) if rest else value}


def planted(evidence, path, value):
    return planted_in(evidence, altered(msgspec.to_builtins(evidence.status), path, value))


def planted_in(evidence, status):
    return examine(msgspec.structs.replace(evidence, status=run_status(status)))


STATUS = {
    "autopilot_lost": (["autopilot_lost"], True),
    "internal_fault": (["internal_faults"], 2),
    "recording_stopped": (["recording"], "recording stopped: records/targets.jsonl: No space left on device"),
    "no_camera": (["vision"], {"works": False, "why": "no camera there"}),
    "vision_stopped": (
        ["vision"],
        {"works": False, "stopped": True, "why": "model m.onnx: its size is open"},
    ),
    "detections_port": (["intake", "why"], "Address already in use"),
    "link_down": (["links", "autopilot"], {"state": "down", "why": "Connection refused"}),
    "no_clock": (["clock"], {"status": "unknown"}),
    "clock_unsettled": (["clock", "sigma_s"], 0.02),
    "no_attitude": (["telemetry", "rates_hz"], {}),
    "gimbal_unused": (["telemetry", "gimbal_unused"], 154),
    "readout_unknown": (["sight", "readout"], {"matters": True, "by_readout_m": 0.4, "sigma_m": 0.8}),
    "too_slow_for_motion": (["telemetry", "too_slow_for_motion"], True),
}


def test_a_recording_that_a_full_disk_stopped_is_its_consequence(healthy):
    full = Folder(
        key="[record] directory", path="/records", writable=True, read_only=False, file_system="ext4", free_bytes=0
    )
    evidence = msgspec.structs.replace(healthy, board=msgspec.structs.replace(healthy.board, folders=[full]))
    (finding,) = planted(evidence, *STATUS["recording_stopped"])
    assert (finding.code, codes(finding.consequences)) == ("disk_full", ["recording_stopped"])


@pytest.mark.parametrize("code", STATUS)
def test_what_the_service_reports_of_itself_is_named(healthy, code):
    path, value = STATUS[code]
    findings = planted(healthy, path, value)
    assert codes(findings) == [code]
    assert all(finding.problem and finding.fix for finding in findings)


def test_a_camera_without_pictures_is_named_by_its_own_source(healthy):
    """Not by the port of the other detector, though both feed the one camera."""
    config = parse(TEXT + '[vision]\nsource = "camera.pipe"\n', "fwav-companion.toml")
    lost = {"works": False, "why": "the camera repeats one picture"}
    (finding,) = planted(msgspec.structs.replace(healthy, config=config), ["vision"], lost)
    assert finding.problem.startswith("no pictures of camera.pipe: ")


REASONS = (
    "across_clock_step",
    "attitude_gap",
    "beyond_terrain",
    "no_range",
    "no_terrain",
    "not_finite",
    "stale_attitude",
    "terrain_unfit",
)


@pytest.mark.parametrize("code", REASONS)
def test_a_reason_that_costs_most_detections_is_named(healthy, code):
    count = healthy.status.detections
    (finding,) = planted(healthy, ["dropped", Reason(code).value], count)
    assert finding.code == code
    assert finding.problem.startswith(f"{count} of ")
    assert planted(healthy, ["dropped", code], round(0.04 * healthy.status.fixes)) == [], "normal in flight"


def far_away(frame):
    return frame | {"detections": [each | {"u": each["u"] + 5000.0} for each in frame["detections"]]}


def test_pixels_of_another_picture_are_named():
    assert found(heard(HEALTHY, frame=far_away)) == ["outside_image"]


def test_a_calibration_that_holds_in_the_middle_alone_is_named(healthy):
    narrow = parse_calibration(CAMERA + "max_angle_deg: 20.0\n", "camera.yaml")
    files = msgspec.structs.replace(healthy.files, calibration=narrow)
    assert found(msgspec.structs.replace(healthy, files=files)) == ["narrow_calibration"]
    narrowed = msgspec.structs.replace(healthy, files=files)
    lost = planted(narrowed, ["dropped", "outside_lens"], healthy.status.detections)
    assert codes(lost) == ["outside_lens", "narrow_calibration"]


def test_frames_signed_with_another_key_are_named(healthy):
    traffic = [{**link, "refused_signatures": 7} for link in msgspec.to_builtins(healthy.status.traffic)]
    assert codes(planted(healthy, ["traffic"], traffic)) == ["wrong_signature"]


@pytest.mark.parametrize(("field", "code"), [("outdated", "outdated_signatures"), ("shed_bytes", "shed_bytes")])
@pytest.mark.parametrize("link", ["autopilot", "ground"])
def test_what_a_link_refuses_for_its_time_or_its_amount_is_a_warning(healthy, link, field, code):
    traffic = msgspec.to_builtins(healthy.status.traffic)
    (one,) = [each for each in traffic if each["name"] == link]
    one[field] = 7
    (finding,) = planted(healthy, ["traffic"], traffic)
    assert (finding.code, finding.level, finding.where) == (code, Level.WARNING, f"link {link}")


def test_bytes_that_are_shed_are_not_named_where_the_whole_link_is_garbage(healthy):
    (autopilot, *others) = msgspec.to_builtins(healthy.status.traffic)
    autopilot |= {"bytes_in": 10_000, "skipped_bytes": 9000, "shed_bytes": 5000}
    assert "shed_bytes" not in codes(planted(healthy, ["traffic"], [autopilot, *others]))


def test_an_autopilot_whose_signatures_are_outdated_is_an_error(healthy):
    status = altered(msgspec.to_builtins(healthy.status), ["autopilot"], None)
    (autopilot, *others) = status["traffic"]
    traffic = [autopilot | {"outdated": 7, "peers": []}, *others]
    levels = {each.code: each.level for each in planted_in(healthy, altered(status, ["traffic"], traffic))}
    assert levels["outdated_signatures"] is Level.ERROR


LINKS = {
    "serial:///dev/ttyAMA0:921600": "TX to RX",
    "udpin://0.0.0.0:14540": "send to this board",
    "udpout://192.168.1.5:14540": "listens at that address",
    "udpbcast://255.255.255.255:14540": "listens at that address",
    "tcpin://0.0.0.0:5760": "connect to this board",
    "tcpout://127.0.0.1:5760": "this port speaks MAVLink",
}


@pytest.mark.parametrize("url", LINKS)
def test_the_fix_of_silence_goes_by_the_kind_of_link(url):
    text = TEXT.replace("udpin://127.0.0.1:14540", url) + '[detections]\nurl = ""\n'
    (finding,) = [each for each in examine(silent(text)) if each.code == "nothing_heard"]
    assert LINKS[url] in finding.fix
    assert ("cable" in finding.fix) == url.startswith("serial"), "only a serial link has one"


@pytest.mark.parametrize(
    ("why", "fix"),
    [("Address already in use", "end that program"), ("no such host: cam.invalid", "an address of this board")],
)
def test_the_fix_of_a_port_that_cannot_be_opened_goes_by_its_reason(healthy, why, fix):
    (finding,) = planted(healthy, ["intake", "why"], why)
    assert finding.problem.endswith(why)
    assert fix in finding.fix


@pytest.mark.parametrize(
    ("url", "fix"), [("serial:///dev/ttyAMA0:921600", "cable"), ("udpin://0.0.0.0:14540", "radio")]
)
def test_the_fix_of_loss_goes_by_the_kind_of_link(healthy, url, fix):
    config = parse(TEXT.replace("udpin://127.0.0.1:14540", url), "flight.toml")
    peers = [{"system": 1, "component": 1, "received": 900, "lost": 100}]
    traffic = [{**msgspec.to_builtins(healthy.status.traffic[0]), "peers": peers}]
    evidence = msgspec.structs.replace(healthy, config=config)
    (finding,) = planted(evidence, ["traffic"], traffic)
    assert finding.code == "loss"
    assert fix in finding.fix


def places(value, path=()):
    """The path of every value inside another."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inside:
        yield (*path, key)
        yield from places(each, (*path, key))


def with_another(value, path, other):
    if not path:
        return other
    copy = value.copy()
    copy[path[0]] = with_another(value[path[0]], path[1:], other)
    return copy


OTHERS = (None, "x", -1, [1], {}, {"a": None}, True)


def test_a_status_of_another_form_is_not_believed_or_breaks_nothing(healthy, written):
    believed = 0
    for path, other in product(places(written), OTHERS):
        status = run_status(with_another(written, path, other))
        if status is not None:
            believed += 1
            evidence = msgspec.structs.replace(healthy, status=status)
            assert list(report_lines(evidence, examine(evidence), "by its status"))
    assert believed > 50 * len(OTHERS)
    assert run_status(written) is not None


@pytest.mark.parametrize("other", OTHERS, ids=repr)
@pytest.mark.parametrize("path", UNJUDGED, ids=".".join)
def test_a_part_that_is_not_judged_may_have_any_form(healthy, written, path, other):
    status = run_status(with_another(written, path, other))
    assert found(msgspec.structs.replace(healthy, status=status)) == []
    assert status.fixes == healthy.status.fixes


def test_every_part_that_another_version_may_lack_has_a_default(written):
    """Only what names a part is required: ids, an origin's place, names, numbers, and peers' addresses."""
    required = {"system", "component", "name", "lat", "lon", "message", "track"}
    for path in places(written):
        if path[-1] not in required and not isinstance(path[-1], int):
            assert run_status(lacking(written, path)) is not None, path


def lacking(value, path):
    if len(path) == 1:
        return {key: each for key, each in value.items() if key != path[0]}
    return with_another(value, path[:1], lacking(value[path[0]], path[1:]))


def test_frames_beyond_the_processor_are_a_warning(healthy):
    (finding,) = planted(healthy, ["dropped", "overload"], healthy.status.intake.came // 3)
    assert (finding.code, finding.level) == ("overload", Level.WARNING)
    assert planted(healthy, ["dropped", "overload"], 3) == []


@pytest.mark.parametrize(("differs", "said"), [(True, "runs 0.5 % slow"), (False, "slips")])
def test_check_names_the_rate_of_a_followed_clock_only_where_it_differs_beyond_its_sigma(healthy, differs, said):
    status = msgspec.to_builtins(healthy.status)
    for key, value in {"status": "followed", "skew": 5e-3, "rate_differs": differs}.items():
        status = altered(status, ["clock", key], value)
    (finding,) = [each for each in planted_in(healthy, status) if each.code == "clock_followed"]
    assert said in finding.problem
    assert ("runs" in finding.problem) is differs
