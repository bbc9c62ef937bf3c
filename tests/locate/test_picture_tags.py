"""Tags that are no pose, flipped or broken: a reason, never a wrong answer; and lenses by their best tag."""

from __future__ import annotations

import math
import random

import msgspec
import pytest

from fwav_companion.photographs.exif_tags import FOCAL_35MM, FOCAL_MM, MAKE, MODEL
from fwav_companion.photographs.lens_from_tags import lens_from_tags
from fwav_companion.photographs.picture_pose import AltDatum, NoLens, NoPose, PictureLens, PicturePose
from fwav_companion.photographs.pose_from_tags import pose_from_tags
from fwav_companion.photographs.tags import PictureTags, xmp_values

GPS = {1: "N", 2: (47.0, 30.0, 0.0), 3: "E", 4: (11.0, 0.0, 0.0), 5: b"\x00", 6: 650.0}


def dji(**values: str) -> PictureTags:
    given = {
        "GpsLatitude": "47.5", "GpsLongitude": "11.0", "AbsoluteAltitude": "+650.0", "RelativeAltitude": "+80.0",
        "GimbalRollDegree": "+0.00", "GimbalPitchDegree": "-60.00", "GimbalYawDegree": "+12.00",
    } | values  # fmt: skip
    return PictureTags(size=(4000, 3000), xmp=given, exif={MAKE: "DJI"})


def test_pose_with_pitch_and_yaw_exactly_zero_is_refused() -> None:
    found = pose_from_tags(dji(GimbalPitchDegree="0.00", GimbalYawDegree="+0.00"))
    assert isinstance(found, NoPose)
    assert "exactly 0" in found.reason


def test_pose_at_zero_zero_is_refused() -> None:
    found = pose_from_tags(dji(GpsLatitude="0.0", GpsLongitude="0.0"))
    assert isinstance(found, NoPose)


@pytest.mark.parametrize(("status", "kind"), [("Normal", PicturePose), ("RTK", PicturePose), ("Invalid", NoPose)])
def test_pose_without_a_valid_position_is_refused(status: str, kind: type) -> None:
    assert isinstance(pose_from_tags(dji(GpsStatus=status)), kind)


def test_pose_without_angles_asks_for_them() -> None:
    found = pose_from_tags(PictureTags(size=(4000, 3000), gps=GPS))
    assert isinstance(found, NoPose)
    assert "--angles" in found.reason
    assert found.place is not None
    assert (found.place.lat_deg, found.place.lon_deg) == (47.5, 11.0)


@pytest.mark.parametrize(
    ("flag", "datum", "shared_m"),
    [("50", AltDatum.ELLIPSOID, 0.03), ("34", AltDatum.ELLIPSOID, 3.0), ("0", AltDatum.EGM96, 30.0)],
)
def test_altitude_of_dji_counts_by_its_rtk_flag(flag: str, datum: AltDatum, shared_m: float) -> None:
    found = pose_from_tags(dji(RtkFlag=flag, RtkStdHgt="0.02", RtkStdLat="0.01", RtkStdLon="0.01"))
    assert isinstance(found, PicturePose)
    assert found.absolute is not None
    assert (found.absolute.datum, found.absolute.sigma.shared) == (datum, shared_m)


@pytest.mark.parametrize(
    ("stated", "datum"), [("EPSG:5773", AltDatum.EGM96), ("ellipsoidal", AltDatum.ELLIPSOID), ("", AltDatum.EGM96)]
)
def test_altitude_of_sensefly_counts_by_its_vertical_system(stated: str, datum: AltDatum) -> None:
    angles = {"Camera:Roll": "1.0", "Camera:Pitch": "2.0", "Camera:Yaw": "3.0"}
    found = pose_from_tags(
        PictureTags(size=(40, 30), xmp=angles | {"Camera:VertCS": stated}, exif={MAKE: "senseFly"}, gps=GPS)
    )
    assert isinstance(found, PicturePose)
    assert found.absolute is not None
    assert found.absolute.datum is datum
    assert bool(found.absolute.note) is not bool(stated)  # what is not stated is said


def test_altitude_of_a_skydio_x10_in_exif_is_above_the_ellipsoid() -> None:
    xmp = {f"CameraOrientationNED/{name}": value for name, value in (("Roll", "0"), ("Pitch", "-60"), ("Yaw", "9"))}
    found = pose_from_tags(PictureTags(size=(40, 30), xmp=xmp, exif={MAKE: "Skydio", MODEL: "Skydio X10"}, gps=GPS))
    assert isinstance(found, PicturePose)
    assert found.absolute is not None
    assert found.absolute.datum is AltDatum.ELLIPSOID
    older = PictureTags(size=(40, 30), xmp=xmp | {"AbsoluteAltitude": "650"}, exif={MAKE: "Skydio", MODEL: "X2"})
    found = pose_from_tags(msgspec.structs.replace(older, gps=GPS))
    assert isinstance(found, PicturePose)
    assert found.absolute is not None
    assert found.absolute.datum is AltDatum.EGM96


def test_altitude_below_the_reference_is_negative() -> None:
    found = pose_from_tags(PictureTags(size=(40, 30), gps=GPS | {5: b"\x01", 6: 12.5}))
    assert isinstance(found, NoPose)
    assert found.place is not None
    assert found.place.absolute is not None
    assert found.place.absolute.metres == -12.5


def test_lens_of_dewarp_data_counts_its_centre_from_the_middle() -> None:
    text = "2021-06-01;3678.87,3671.84,10.1,27.29,-0.2687,0.1147,0.000015,-0.000046,-0.035"
    found = lens_from_tags(dji(DewarpData=text, DewarpFlag="0", CalibratedFocalLength="3600"))
    assert isinstance(found, PictureLens)
    assert found.principal_point == pytest.approx((1999.5 + 10.1, 1499.5 + 27.29))
    assert found.focal_px == (3678.87, 3671.84)
    assert found.distortion == (-0.2687, 0.1147, 0.000015, -0.000046, -0.035)


def test_lens_of_a_corrected_picture_has_no_distortion() -> None:
    text = "2021-06-01;3678.87,3671.84,10.1,27.29,-0.2687,0.1147,0.000015,-0.000046,-0.035"
    found = lens_from_tags(dji(DewarpData=text, DewarpFlag="1"))
    assert isinstance(found, PictureLens)
    assert found.distortion == ()


def test_lens_of_a_thermal_picture_is_not_the_visible_camera_s() -> None:
    tags = PictureTags(size=(640, 512), exif={MODEL: "MAVIC2-ENTERPRISE-ADVANCED", FOCAL_35MM: 24})
    found = lens_from_tags(tags)
    assert isinstance(found, PictureLens)
    assert found.focal_px[0] == pytest.approx(760.0)
    unknown = PictureTags(size=(640, 512), xmp={"ImageSource": "InfraredCamera"}, exif={FOCAL_35MM: 24})
    assert isinstance(lens_from_tags(unknown), NoLens)


@pytest.mark.parametrize(("focal_mm", "field_deg"), [(13.0, 45.4), (19.0, 31.9), (25.0, 24.6)])
def test_lens_of_an_xt2_is_by_its_focal_length(focal_mm: float, field_deg: float) -> None:
    tags = PictureTags(size=(640, 512), exif={MODEL: "XT2", FOCAL_MM: focal_mm, FOCAL_35MM: 40})
    found = lens_from_tags(tags)
    assert isinstance(found, PictureLens)
    assert 2.0 * math.degrees(math.atan(320.0 / found.focal_px[0])) == pytest.approx(field_deg, abs=0.1)
    assert found.source == "table of thermal cameras"


@pytest.mark.parametrize(
    ("size", "exif"),
    [
        ((640, 512), {MODEL: "XT2", FOCAL_35MM: 40}),
        ((640, 512), {MODEL: "ZENMUSE XT S", FOCAL_MM: 19.0, FOCAL_35MM: 40}),
        ((336, 256), {MODEL: "XT S", FOCAL_MM: 6.8}),
    ],
)
def test_thermal_camera_without_known_lens_is_named(size: tuple[int, int], exif: dict[int, object]) -> None:
    found = lens_from_tags(PictureTags(size=size, exif=exif))
    assert isinstance(found, NoLens)
    assert str(exif[MODEL]) in found.reason
    assert found.reason.endswith("give --hfov DEG or --camera FILE")


def test_xmp_of_a_struct_keeps_siblings_apart() -> None:
    packet = (
        '<x:xmpmeta><rdf:RDF><rdf:Description rdf:about=""><s:FLU rdf:parseType="Resource"><s:Yaw>1</s:Yaw></s:FLU>'
        '<s:NED rdf:parseType="Resource"><s:Yaw>2</s:Yaw></s:NED></rdf:Description><rdf:Description s:Roll="3/2"/>'
        "</rdf:RDF></x:xmpmeta>"
    )
    found = xmp_values(packet)
    assert (found["FLU/Yaw"], found["NED/Yaw"], found["Roll"]) == ("1", "2", "3/2")


def test_xmp_that_is_mutated_raises_nothing() -> None:
    rng = random.Random(5)
    packet = ('<x:xmpmeta xmlns:x="a"><rdf:Description drone-dji:GimbalPitchDegree="-60.0" '
              'drone-dji:GimbalYawDegree="1/3"><a:b>4</a:b></rdf:Description></x:xmpmeta>')  # fmt: skip
    for _ in range(200):
        text = list(packet)
        for _ in range(rng.randint(1, 6)):
            at = rng.randrange(len(text))
            text[at : at + rng.randint(0, 4)] = rng.choice(["<", ">", '"', "/", "é", "\0", "NaN", "1e999", ""])
        tags = PictureTags(size=(40, 30), xmp=xmp_values("".join(text)), gps=GPS)
        assert isinstance(pose_from_tags(tags), PicturePose | NoPose)
        assert isinstance(lens_from_tags(tags), PictureLens | NoLens)


def test_direction_of_exif_with_the_mount_of_the_configuration_is_a_pose(tmp_path, capsys):
    """A geotagged picture of a camera that looks down in a level vehicle: position, altitude and direction in EXIF."""
    import json

    from PIL import Image

    from fwav_companion.cli.main import main

    path = tmp_path / "a.jpg"
    image = Image.new("RGB", (400, 300))
    exif = image.getexif()
    exif.get_ifd(0x8825).update({1: "N", 2: (47.0, 0.0, 0.0), 3: "E", 4: (11.0, 0.0, 0.0), 6: 480.0, 16: "T", 17: 90.0})
    image.save(path, exif=exif)
    (tmp_path / "c.toml").write_text('[detections]\nurl = ""\n[camera.mount]\npitch_deg = -90.0\n')
    words = ["locate", str(path), "--pixel", "199.5,0", "--hfov", "60", "--ground-alt", "400", "--json"]
    assert main(words) == 2
    assert "--angles" in capsys.readouterr().err
    assert main([*words, "--config", str(tmp_path / "c.toml")]) == 0
    answers = json.loads(capsys.readouterr().out.splitlines()[-1])
    (target,) = answers["targets"]
    assert target["lat"] == pytest.approx(47.0, abs=1e-6)
    assert target["lon"] > 11.0003  # the image's top is in the east: 150 px of 346 are 35 m
    assert any("level vehicle" in note for note in answers["assumed"])
