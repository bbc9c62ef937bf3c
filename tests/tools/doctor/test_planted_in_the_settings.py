"""Settings that make every fix wrong: each is named with what was heard."""

import msgspec
import pytest
from draws import first_of, first_rows_of
from hearing import codes, consequences, evidence_of, flown, found, heard

from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Level
from sitl_mock import scenario

HEALTHY = scenario("unbiased").but({"seed": 3})
NADIR = scenario("nadir").but({"seed": 3})


# Filters.


def test_labels_that_filter_everything_are_an_error_that_names_what_was_heard():
    (finding,) = examine(heard(HEALTHY, ['detections.labels=["boat"]']))
    assert (finding.code, finding.level) == ("other_label", Level.ERROR)
    assert '"boat"' in finding.problem
    assert '"target"' in finding.problem


def test_a_score_that_filters_everything_is_an_error_that_names_the_best():
    (finding,) = examine(heard(HEALTHY, ["detections.min_score=2.0"]))
    assert (finding.code, finding.level) == ("low_score", Level.ERROR)
    assert "the best scored 0." in finding.problem


@pytest.mark.parametrize(("every", "expected"), [(1, []), (5, [Level.NOTE])])
def test_a_filter_that_passes_something_is_a_note_at_most(every, expected):
    count = 0

    def labelled(frame):
        nonlocal count
        count += 1
        label = "target" if count % every == 0 else "tree"
        return frame | {"detections": [each | {"label": label} for each in frame["detections"]]}

    findings = examine(heard(HEALTHY, ['detections.labels=["target"]'], frame=labelled))
    assert [finding.level for finding in findings] == expected


# The mount.


@pytest.mark.parametrize("flight", [HEALTHY, NADIR], ids=["pitched", "level"])
def test_radians_for_degrees_are_an_error_that_names_the_angle(flight):
    (finding,) = examine(heard(flight, ["camera.mount.pitch_deg=-1.5708"]))
    assert (finding.code, finding.level) == ("mount_in_radians", Level.ERROR)
    assert "pitch_deg = -1.5708" in finding.problem
    assert finding.fix == "write degrees: pitch_deg = -90.0"
    assert consequences(finding) == {"above_horizon"}


@pytest.mark.parametrize(
    "angles", [(0.0, -90.0, 0.0), (0.0, 0.0, 0.0), (1.6, -88.3, 0.4), (0.0, -45.0, 1.5708), (1.0, -2.5, 3.0)]
)
def test_degrees_are_not_taken_for_radians(angles):
    settings = [
        f"camera.mount.{axis}_deg={angle}" for axis, angle in zip(("roll", "pitch", "yaw"), angles, strict=True)
    ]
    assert "mount_in_radians" not in found(evidence_of(flown(HEALTHY, settings, seconds=1.0)))


def test_a_lever_arm_in_millimetres_is_named_in_metres():
    settings = ["camera.mount.position_m=[50, 0, -20]"]
    by_code = {each.code: each for each in examine(evidence_of(flown(HEALTHY, settings, seconds=1.0)))}
    finding = by_code["lever_arm_long"]
    assert finding.level is Level.WARNING
    assert finding.problem == "[50, 0, -20]: the camera would be 54 m from the vehicle's reference point"
    assert finding.fix == "write metres: [0.05, 0, -0.02] if these are mm, [0.5, 0, -0.2] if cm"


def test_a_lever_arm_of_a_large_vehicle_is_right():
    settings = ["camera.mount.position_m=[2.5, 0, 1.0]"]
    assert "lever_arm_long" not in found(evidence_of(flown(HEALTHY, settings, seconds=1.0)))


@pytest.mark.parametrize("pitch_deg", first_of(5.0, 60.0, 75.0))
def test_a_mount_that_looks_at_the_sky_is_an_error_that_names_what_was_heard(pitch_deg):
    (finding,) = examine(heard(HEALTHY, [f"camera.mount.pitch_deg={pitch_deg}"]))
    assert (finding.code, finding.level) == ("above_horizon", Level.ERROR)
    assert "above the horizon" in finding.problem
    assert " detections look " in finding.problem


@pytest.mark.parametrize(("elevation_deg", "code"), [(-58.0, "direction_uncertain"), (-45.0, "above_horizon")])
def test_refused_as_too_flat_blames_the_mount_only_where_the_picture_nears_the_horizon(elevation_deg, code):
    """The picture reaches 34 deg from the axis; a loaded board knew the clock to 0.2 s, and the mount was blamed."""
    evidence = evidence_of(flown(HEALTHY, [], seconds=6.0))
    sight = msgspec.structs.replace(evidence.status.seen, axis_elevation_deg=elevation_deg)
    dropped = {**evidence.status.dropped, "too_shallow": 327}
    status = msgspec.structs.replace(evidence.status, sight=sight, dropped=dropped)
    findings = found(msgspec.structs.replace(evidence, status=status))
    assert {"direction_uncertain", "above_horizon"} & set(findings) == {code}


@pytest.mark.parametrize(("pitch_deg", "level"), [(90.0, Level.ERROR), (0.0, Level.WARNING)])
def test_a_mount_that_looks_at_the_sky_is_named_without_a_detection(pitch_deg, level):
    """At pitch 37 deg a camera that looks ahead sees sky alone; level, it would see ground."""
    empty = {"camera.missed": 1.0, "camera.clutter": 0.0}
    (finding,) = examine(heard(HEALTHY.but(empty), [f"camera.mount.pitch_deg={pitch_deg}"]))
    assert (finding.code, finding.level) == ("above_horizon", level)
    assert "no part of the image" in finding.problem


@pytest.mark.parametrize(
    ("name", "yaw_deg"),
    first_rows_of(("figure_eight", -90.0), ("hover", 180.0), ("unbiased", 90.0), ("nadir", 90.0), few=2),
)
def test_a_mount_turned_by_a_right_angle_is_an_error_that_names_the_turn(name, yaw_deg):
    (finding,) = examine(heard(scenario(name).but({"seed": 3}), [f"camera.mount.yaw_deg={yaw_deg}"], seconds=13.0))
    assert (finding.code, finding.level) == ("fixes_disagree", Level.ERROR)
    assert "yaw_deg = 0:" in finding.fix


def test_fixes_that_disagree_for_another_reason_are_a_warning():
    """A mount turned by 45 deg: no right angle mends it."""
    findings = examine(heard(scenario("figure_eight").but({"seed": 3}), ["camera.mount.yaw_deg=45.0"], seconds=13.0))
    assert [(each.code, each.level) for each in findings] == [("fixes_disagree", Level.WARNING)]
    assert "check --shake" in findings[0].fix


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        ("outliers", 4),
        ("racetrack", 13),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in (("default", 22), ("hover", 4), ("figure_eight", 18))),
    ],
)
def test_fixes_within_their_claims_agree(name, seed):
    """Biases are drawn from the configured priors; racetrack 13 has false detections while no target is in view."""
    assert "fixes_disagree" not in found(heard(scenario(name).but({"seed": seed}), seconds=16.0))


@pytest.mark.parametrize(("motion", "expected"), [("static", ["fixes_disagree"]), ("moving", [])])
def test_a_target_that_moves_is_named_where_it_is_configured_to_stand(motion, expected):
    walker = scenario("walker").but({"seed": 2})
    findings = examine(heard(walker, [f"tracking.motion={motion}"], seconds=16.0))
    assert codes(findings) == expected
    assert all('motion = "moving"' in finding.fix for finding in findings)


def test_a_receiver_that_wanders_as_configured_leaves_fixes_in_agreement():
    wander = {"position_bias_m": 4.0, "position_bias_time_s": 5.0}
    flight = scenario("hover").but({"seed": 4} | {f"priors.{name}": value for name, value in wander.items()})
    settings = [f"uncertainty.{name}={value}" for name, value in wander.items()]
    evidence = heard(flight, settings)
    assert evidence.status.sight.agreement.apart_m > 0.8
    assert found(evidence) == []


# Frames whose stamps grow old.


def test_stamps_that_grow_old_are_named_before_frames_are_refused():
    late = 0.0

    def queued(frame):
        nonlocal late
        late += 0.0015
        return frame | {"time_monotonic": frame["time_monotonic"] - late}

    (finding,) = examine(heard(HEALTHY, frame=queued, seconds=13.0))
    assert (finding.code, finding.level) == ("stamps_grow_old", Level.WARNING)
    assert "later and later" in finding.problem


@pytest.mark.parametrize(("rate", "word"), [(-0.01, "1.0% slower"), (0.01, "1.0% faster")])
def test_a_clock_of_another_rate_is_named(rate, word):
    first: list[float] = []

    def drifting(frame):
        first.append(frame["time_monotonic"])
        return frame | {"time_monotonic": frame["time_monotonic"] + rate * (frame["time_monotonic"] - first[0])}

    (finding,) = examine(heard(HEALTHY, frame=drifting, seconds=13.0))
    assert finding.code == "stamps_drift"
    assert word in finding.problem


@pytest.mark.parametrize("back_s", [0.05, 0.2, 0.4, 1.0])
def test_stamps_that_jump_back_and_forth_are_named(back_s):
    count = 0

    def jumping(frame):
        nonlocal count
        count += 1
        return frame | {"time_monotonic": frame["time_monotonic"] - back_s * (count // 7 % 2)}

    assert "stamps_jump" in found(heard(HEALTHY, frame=jumping))


def test_stamps_that_repeat_are_named():
    """A detector that reads its clock for every third picture."""
    count, stamp = 0, 0.0

    def stuck(frame):
        nonlocal count, stamp
        stamp = frame["time_monotonic"] if count % 3 == 0 else stamp
        count += 1
        return frame | {"time_monotonic": stamp}

    (finding,) = examine(heard(HEALTHY, frame=stuck))
    assert (finding.code, finding.level) == ("stamps_repeat", Level.ERROR)


def test_frames_that_come_late_and_out_of_order_do_not_jump():
    late = HEALTHY.but({"camera.late_every": 3, "camera.late_by_s": 0.31})
    assert not {"stamps_jump", "stamps_repeat"} & set(found(heard(late)))


def test_stamps_that_are_always_old_do_not_grow():
    def slow(frame):
        return frame | {"time_monotonic": frame["time_monotonic"] - 0.3}

    assert "stamps_grow_old" not in found(heard(HEALTHY.but({"camera.latency_jitter_s": 0.05}), frame=slow))


GROUNDS = {
    "rangefinder": (["ground.model=rangefinder"], "height by the rangefinder"),
    "fixed": (["ground.model=fixed", "ground.height_m=10"], "height by [ground] height_m"),
    "home": ([], "height by GLOBAL_POSITION_INT"),
}


@pytest.mark.parametrize("ground", GROUNDS)
def test_vehicle_without_a_position_localizes_below_the_camera_only_by_a_named_height(ground):
    settings, height = GROUNDS[ground]
    evidence = heard(HEALTHY.but({"autopilot.gps": False}), settings)
    later = msgspec.structs.replace(evidence.status.telemetry, relative_world=True)  # ten seconds after the start
    evidence = msgspec.structs.replace(evidence, status=msgspec.structs.replace(evidence.status, telemetry=later))
    finding = next(each for each in examine(evidence) if each.code == "no_position")
    assert "localizes below the camera only" in finding.problem
    assert finding.problem.endswith(height)


def test_vehicle_whose_position_is_not_used_on_purpose_is_noted_with_its_height():
    (finding,) = examine(heard(HEALTHY, ["vehicle.position=none", "ground.model=rangefinder"]))
    assert (finding.code, finding.level) == ("below_camera_only", Level.NOTE)
    assert finding.problem == "localizes below the camera only, as configured; height by the rangefinder"


def test_barometer_that_cannot_be_used_is_not_named_where_another_sensor_shows_the_height():
    evidence = heard(HEALTHY, ["ground.model=rangefinder"])
    changed = msgspec.structs.replace(evidence.status.telemetry, height_source=None, barometer_starts_in_air=True)
    status = msgspec.structs.replace(evidence.status, telemetry=changed)
    assert examine(msgspec.structs.replace(evidence, status=status)) == []


@pytest.mark.parametrize(
    ("telemetry", "code", "level"),
    [
        ({"height_source": "barometer (VFR_HUD)"}, "height_barometric", Level.NOTE),
        ({"height_source": None, "barometer_starts_in_air": True}, "height_starts_in_air", Level.WARNING),
    ],
)
def test_height_by_a_barometer_alone_is_named_and_one_that_cannot_be_used(telemetry, code, level):
    evidence = heard(HEALTHY)
    changed = msgspec.structs.replace(evidence.status.telemetry, **telemetry)
    status = msgspec.structs.replace(evidence.status, telemetry=changed)
    (finding,) = examine(msgspec.structs.replace(evidence, status=status))
    assert (finding.code, finding.level) == (code, level)
