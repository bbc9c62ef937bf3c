"""Blocks that stand on the ground, drawn by the mock's own geometry, from all view angles; no other error."""

from math import atan2, degrees, hypot, radians, tan

import pytest
from draws import first_of
from flying import fly

from fwav_companion.recording.line_types import SightingLine, TargetLine
from sitl_mock import TargetOptions, scenario

HEIGHT_M = 1.7
RING = tuple((away, north, east) for away in (1.0, 5.0, 9.0, 14.0) for north, east in ((1, 0), (0, 1), (-0.7, -0.7)))
WIDE_M = 0.5
EXACT_STAMPS = "[uncertainty]\nattitude_stamp_delay_s = 0.001\n"
"""The mean of this delay is that of cut stamps, so that whole-millisecond stamps are used as they are. An attitude a
millisecond late moves a foot at 58 deg by up to 0.1 m."""


def fixes(anchor, width_m, pitch_deg=37.0):
    """(view angle, horizontal error, budget of the target's height) of every fix of a box that the image does not cut
    off."""
    targets = tuple(
        TargetOptions(label=f"{i}", north=away * n, east=away * e, height_m=HEIGHT_M, width_m=width_m)
        for i, (away, n, e) in enumerate(RING)
    )
    options = scenario("perfect").but(
        {
            "flight.pattern": "figure_eight",
            "flight.half_axes_m": (8.0, 5.0),
            "flight.height_m": 10.0,
            "flight.pitch_deg": pitch_deg,
            "flight.speed_m_s": 4.0,
            "camera.fps": 6.0,
            "camera.exposure_s": 0.0,
            "autopilot.attitude_on_whole_ms": True,
            "seconds": 22.0,
            "targets": targets,
        }
    )
    texts = [f'[[target]]\nlabel = "{i}"\nheight_m = {HEIGHT_M}\nanchor = "{anchor}"\n' for i in range(len(RING))]
    link = '[[link]]\nname = "autopilot"\nurl = "udpin://127.0.0.1:14540"\nrole = "autopilot"\n'
    camera = '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n[rates]\nattitude = 50\n'
    text = f"{link}{camera}{EXACT_STAMPS}{''.join(texts)}"
    flight = fly(options, text=text, sightings=True)
    found, labels = [], {}
    for line in flight.companion.lines:
        if isinstance(line, TargetLine) and line.fix:
            labels[line.frame, round(line.fix.north, 6)] = int(line.label)
    for line in flight.companion.lines:
        if not isinstance(line, SightingLine) or line.ground_ned is None:
            continue
        north, east, down = line.ground_ned
        index = labels.get((line.frame, round(north, 6)))
        if index is None:
            continue
        camera = flight.mock.camera
        left, top, right, bottom = camera.box(flight.mock.scene[index], camera.row0_s(line.frame))
        if not (left > 2 and top > 2 and right < 637 and bottom < 477):
            continue
        true = flight.mock.scene[index].at(0.0)
        camera_n, camera_e, camera_d = line.camera_ned
        angle = degrees(atan2(hypot(true[0] - camera_n, true[1] - camera_e), -camera_d))
        found.append((angle, hypot(north - true[0], east - true[1]), line.budget.target or 0.0))
        assert down == pytest.approx(0.0, abs=0.05)
    assert len(found) > 100
    assert {int(angle // 10.0) for angle, _, _ in found} >= ({1, 2, 3, 4, 5} if pitch_deg else {0, 1, 2})
    return found


def test_without_a_height_a_person_seen_at_an_angle_is_half_a_metre_off():
    """The middle of a person is 0.85 m above the ground: 0.64 m at 37 deg."""
    off = [error for angle, error, _ in fixes("ground", 0.1) if 35.0 < angle < 39.0]
    assert 0.5 < min(off) < 0.75


all_angles = pytest.mark.parametrize("pitch_deg", first_of(37.0, 0.0))


@all_angles
@pytest.mark.parametrize("width_m", first_of(WIDE_M, 0.1))
def test_the_middle_of_a_box_marks_the_middle_of_a_thing(width_m, pitch_deg):
    """From all angles; perspective moves the middle of the box by a tenth of its height at most."""
    for angle, error, claimed in fixes("center", width_m, pitch_deg):
        assert error < 0.06 + 0.08 * HEIGHT_M * hypot(1.0, angle / 30.0), angle
        assert error < 3.0 * claimed + 0.06


@all_angles
def test_the_foot_of_a_box_is_the_side_toward_the_nadir(pitch_deg):
    """The box of a slim block is wider than its axis by half the diagonal of its base."""
    for angle, error, claimed in fixes("bottom", 0.1, pitch_deg):
        assert error < 0.16, angle
        # Where the box ends, 0.058 of the height, is its error; near the nadir it is that of the middle's height.
        assert claimed == pytest.approx(0.058 * HEIGHT_M * tan(radians(angle)), rel=0.05, abs=0.01) or angle < 15.5


def test_the_foot_of_a_wide_block_is_at_most_its_width_nearer():
    """Half of its diagonal, and half as much where it is seen across the image's axes: its box is wider than itself."""
    off = [error for angle, error, _ in fixes("bottom", WIDE_M) if angle > 20.0]
    assert 0.2 < max(off) < 0.75 * WIDE_M * 2**0.5
