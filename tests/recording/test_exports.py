"""Targets for other tools, judged by readers that are not ours: geojson, fastkml, lxml, csv, and pymap3d for places."""

import csv
import io
import json
import math
import re
from pathlib import PurePath

import geojson
import msgspec
import numpy as np
import pymap3d
import pytest
from fastkml import kml
from fastkml.utils import find_all
from fastkml.validator import validate
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from fwav_companion.errors import InputFileError
from fwav_companion.recording.exports import export_for
from fwav_companion.recording.exports.base import ellipse95
from fwav_companion.recording.line_types import HeaderLine, OriginObject, TargetLine

ORIGIN = {"lat": 48.1372, "lon": 11.5756, "alt_amsl": 519.0}
COV = [[4.0, 1.2, 0.0], [1.2, 1.0, 0.0], [0.0, 0.0, 0.25]]
NAME = 'Mrs. <Müller> & "son"\x07'


def target(track=1, *, time=0.0, north=40.0, east=-25.0, state="confirmed", label=NAME, vel=None, place=True):
    lat, lon, _ = pymap3d.ned2geodetic(north, east, 0.0, ORIGIN["lat"], ORIGIN["lon"], ORIGIN["alt_amsl"])
    line = {
        "type": "target", "time_unix": 1_790_000_000.0 + time, "time_boot": 40.0 + time, "frame": 1, "track": track,
        "label": label, "state": state, "north": north, "east": east, "down": 0.0,
        "lat": float(lat) if place else None, "lon": float(lon) if place else None,
        "alt_amsl": 519.0 if place else None, "cov": COV, "vel": vel, "vel_cov": None, "fix": None,
    }  # fmt: skip
    return msgspec.convert(line, TargetLine)


def exported(suffix, *lines):
    export = export_for(PurePath(f"targets{suffix}"))
    export.add(HeaderLine(version="1", origin=OriginObject(**ORIGIN), unix_offset_s=0.0))
    for line in lines:
        export.add(line)
    return export.content()


def test_geojson_is_valid_and_says_where_and_how_sure():
    moving = [target(2, time=t, north=10.0 + t, vel=[1.0, 0.0, 0.0]) for t in range(5)]
    content = exported(".geojson", target(), target(state="coasting", north=41.0), *moving)
    assert geojson.loads(content).is_valid, geojson.loads(content).errors()
    read = json.loads(content)  # the reader above rounds to 0.1 m
    kinds = [(f["properties"]["track"], f["geometry"]["type"]) for f in read["features"]]
    assert kinds == [(1, "Point"), (1, "Polygon"), (2, "Point"), (2, "Polygon"), (2, "LineString")]
    point, outline = read["features"][:2]
    north, east, _ = to_ned(point["geometry"]["coordinates"])
    assert (north, east) == pytest.approx((41.0, -25.0), abs=1e-3)
    assert point["properties"]["label"] == NAME
    assert len(read["features"][4]["geometry"]["coordinates"]) == 5
    ring = np.array([to_ned(corner)[:2] for corner in outline["geometry"]["coordinates"][0]]) - (41.0, -25.0)
    assert is_the_95_percent_ellipse(ring)
    assert signed_area(ring[:, ::-1]) > 0.0, "RFC 7946: outer rings run counter-clockwise"


def is_the_95_percent_ellipse(ring):
    """(N, 2) north and east from the target, m: every corner on it, by the chi-square with two degrees of freedom."""
    squares = np.einsum("ij,jk,ik->i", ring, np.linalg.inv(np.array(COV)[:2, :2]), ring)
    return np.allclose(squares, -2.0 * math.log(0.05), rtol=1e-3)


def to_ned(coordinates):
    return pymap3d.geodetic2ned(coordinates[1], coordinates[0], 519.0, ORIGIN["lat"], ORIGIN["lon"], 519.0)


def signed_area(ring):
    x, y = ring[:, 0], ring[:, 1]
    return 0.5 * float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


def test_kml_is_read_by_others_with_its_ellipse():
    content = exported(".kml", target(), target(2, vel=[1.0, 0.0, 0.0]), target(2, time=1.0, vel=[1.0, 0.0, 0.0]))
    root = etree.fromstring(content)
    assert root.tag == "{http://www.opengis.net/kml/2.2}kml"
    read = kml.KML.from_string(etree.tostring(root, encoding="unicode"))
    marks = list(find_all(read, of_type=kml.Placemark))
    assert [mark.geometry.geom_type for mark in marks] == ["Point", "Polygon", "Point", "Polygon", "LineString"]
    pin, outline = marks[:2]
    assert (pin.geometry.y, pin.geometry.x) == pytest.approx(target().lat_lon, abs=1e-12)
    assert pin.name == 'Mrs. <Müller> & "son"? #1'
    assert "confirmed; within 4.20 m (95 %); semi-axes of the 95 % ellipse 5.15 m and 1.86 m" in pin.description
    assert outline.name == f"{pin.name}: 95 % ellipse"
    assert outline.geometry.exterior.coords[0] == outline.geometry.exterior.coords[-1]
    assert pin.times is not None
    ring = np.array([to_ned(corner)[:2] for corner in outline.geometry.exterior.coords]) - (40.0, -25.0)
    assert is_the_95_percent_ellipse(ring)
    farthest = ring[np.argmax(np.hypot(*ring.T))]
    values, axes = np.linalg.eigh(np.array(COV)[:2, :2])
    assert np.hypot(*farthest) == pytest.approx(math.sqrt(-2.0 * math.log(0.05) * values[1]), rel=5e-3)
    assert abs(farthest @ axes[:, 1]) == pytest.approx(np.hypot(*farthest), rel=5e-3), "turned as the covariance is"


def test_kml_is_what_the_schema_of_the_ogc_allows(tmp_path):
    moving = [target(2, time=float(t), vel=[1.0, 0.0, 0.0]) for t in range(3)]
    for number, lines in enumerate(([target(), *moving], [], [target(place=False)])):
        path = tmp_path / f"{number}.kml"
        path.write_bytes(exported(".kml", *lines))
        assert validate(file_to_validate=path)


@pytest.mark.parametrize("origin", [(-33.9, 151.2), (69.6, -179.9999), (0.0001, 0.0001)])
def test_ellipses_keep_their_shape_everywhere(monkeypatch, origin):
    """Also where degrees of longitude are short, and across the date line."""
    place = dict(zip(("lat", "lon"), origin, strict=True)) | {"alt_amsl": 519.0}
    monkeypatch.setitem(globals(), "ORIGIN", place)
    for feature in json.loads(exported(".geojson", target()))["features"][1:]:
        ring = np.array([to_ned(corner)[:2] for corner in feature["geometry"]["coordinates"][0]]) - (40.0, -25.0)
        assert is_the_95_percent_ellipse(ring)


def tags(*numbered_labels):
    return [target(track, label=label) for track, label in numbered_labels]


def test_tags_have_the_names_of_the_report():
    lines = tags((4, "tag36h11:19"), (5, "person"), (9, "person"))
    expected = ["tag 19", "person #5", "person #9"]
    features = json.loads(exported(".geojson", *lines))["features"]
    assert [each["properties"]["name"] for each in features if each["properties"]["what"] == "target"] == expected
    assert features[0]["properties"]["label"] == "tag36h11:19"
    folders = etree.fromstring(exported(".kml", *lines)).iterfind(".//{*}Folder")
    assert [folder.findtext("{*}name") for folder in folders] == expected
    rows = list(csv.DictReader(io.StringIO(exported(".csv", *lines).decode())))
    assert [row["target"] for row in rows] == ["tag 19", "person", "person"]
    assert rows[0]["label"] == "tag36h11:19"


def test_two_families_with_one_number_keep_their_labels():
    features = json.loads(exported(".geojson", *tags((1, "tag36h11:3"), (2, "tag16h5:3"))))["features"]
    assert {each["properties"]["name"] for each in features} == {"tag36h11:3", "tag16h5:3"}


@pytest.mark.parametrize("suffix", [".geojson", ".kml", ".csv"])
def test_every_uncertainty_is_named_and_of_95_percent(suffix):
    content = exported(suffix, target()).decode()
    assert "sigma" not in content
    assert not re.search(r"90 ?%|90_", content)
    assert re.search(r"95 %|95_", content)


def test_csv_has_a_row_a_line():
    dropped = msgspec.structs.replace(target(state="dropped"), reason="not_seen")
    text = exported(".csv", target(), dropped, target(3, label="=1+1", place=False)).decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["state"] for row in rows] == ["confirmed", "dropped", "confirmed"]
    assert rows[1]["reason"] == "not_seen"
    assert rows[2]["lat"] == ""
    assert rows[2]["label"] == "'=1+1"
    assert float(rows[0]["lat"]) == target().lat
    values = np.linalg.eigvalsh(np.array(COV)[:2, :2])
    semi_axes = (float(rows[0]["ellipse95_minor_m"]), float(rows[0]["ellipse95_major_m"]))
    assert semi_axes == pytest.approx(tuple(np.sqrt(-2.0 * math.log(0.05) * values)))
    assert float(rows[0]["down95_m"]) == pytest.approx(1.96 * 0.5)
    assert rows[0]["utc"] == "2026-09-21T14:13:20.000Z"


@pytest.mark.parametrize("suffix", [".geojson", ".kml", ".csv"])
def test_nothing_found_and_no_position_are_whole_files_too(suffix):
    for lines in ((), (target(state="tentative"),), (target(place=False),)):
        content = exported(suffix, *lines)
        if suffix == ".kml":
            assert etree.fromstring(content) is not None
        if suffix == ".geojson":
            read = geojson.loads(content)
            assert all(feature["geometry"] is None for feature in read["features"])


@pytest.mark.parametrize("suffix", [".geojson", ".kml", ".gpx"])
@pytest.mark.parametrize("missing", ["lat", "lon"])
def test_latitude_or_longitude_alone_is_no_position(suffix, missing):
    half = msgspec.structs.replace(target(), **{missing: None})
    assert exported(suffix, half) == exported(suffix, msgspec.structs.replace(half, lat=None, lon=None))


@pytest.mark.parametrize("name", ["targets", "targets.shp", ".kml"])
def test_another_form_is_refused_with_what_is_accepted(name):
    with pytest.raises(InputFileError, match=r"accepted: \.geojson, \.kml, \.csv"):
        export_for(PurePath(name))


@given(st.floats(0.01, 100), st.floats(0.01, 100), st.floats(0, 179.9))
def test_the_ellipse_is_the_one_of_its_covariance(a, b, bearing_deg):
    major, minor = max(a, b), min(a, b)
    c, s = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    nn, ee = major**2 * c * c + minor**2 * s * s, major**2 * s * s + minor**2 * c * c
    ne = (major**2 - minor**2) * c * s
    ellipse, scale = ellipse95([[nn, ne, 0], [ne, ee, 0], [0, 0, 0]]), math.sqrt(-2.0 * math.log(0.05))
    assert (ellipse.major_m, ellipse.minor_m) == pytest.approx((scale * major, scale * minor), rel=1e-6, abs=1e-4)
    if major > 1.01 * minor:
        assert math.cos(2 * math.radians(ellipse.bearing_deg - bearing_deg)) == pytest.approx(1.0, abs=1e-6)
