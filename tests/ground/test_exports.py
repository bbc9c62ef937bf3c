"""Exports, read back by other programs' readers."""

from __future__ import annotations

import csv
import io
import xml.etree.ElementTree as ET
from math import cos, hypot, radians, sin

import geojson as reader
import msgspec
import pymap3d
import pytest
from cot_schema import complaints
from fastkml import KML

from fwav_companion.ground.exports import cot_events, csv_table, geojson, kml, one_document, outline
from fwav_companion.ground.views import EllipseView, TargetView, VehicleView

ELLIPSE = EllipseView(3.0, 1.0, 30.0)
TARGET = TargetView(
    id="1/4", vehicle="1", track="4", label="<a & b>", state="confirmed", lat=48.1, lon=11.5, alt_amsl=520.0,
    ellipse=ELLIPSE, radius95_m=2.7, first_unix=1_790_000_000.0, seen_unix=1_790_000_060.0, source="status",
)  # fmt: skip
PLACED = {"companion": 1_790_000_000.0, "position": 1_790_000_000.0 - 45.0}
VEHICLE = VehicleView(id="1", heard_unix=1_790_000_000.0, heard=PLACED, lat=48.2, lon=11.6, heading_deg=12.0)
"""Its autopilot died 45 s ago: its place is that old."""


def test_the_outline_has_its_axes_and_bearing():
    points = [pymap3d.geodetic2ned(lat, lon, 0.0, 48.1, 11.5, 0.0)[:2] for lat, lon in outline(48.1, 11.5, ELLIPSE)]
    assert points[0] == pytest.approx(points[-1], abs=1e-9)
    assert max(hypot(*each) for each in points) == pytest.approx(3.0, rel=1e-4)
    assert min(hypot(*each) for each in points) == pytest.approx(1.0, rel=1e-4)
    along = max(points, key=lambda each: each[0])
    assert hypot(*points[0]) == pytest.approx(3.0, rel=1e-4)
    assert points[0] == pytest.approx((3.0 * cos(radians(30.0)), 3.0 * sin(radians(30.0))), abs=1e-3)
    assert along[0] > 0.0


def test_geojson_is_valid_and_has_points_and_polygons():
    document = reader.loads(geojson([TARGET], [VEHICLE]))
    assert document.is_valid
    kinds = [(feature["properties"]["kind"], feature["geometry"]["type"]) for feature in document["features"]]
    assert kinds == [("target", "Point"), ("ellipse95", "Polygon"), ("vehicle", "Point")]
    assert document["features"][0]["geometry"]["coordinates"][:2] == [11.5, 48.1]
    times = [document["features"][2]["properties"][name] for name in ("heard_utc", "placed_utc")]
    assert times == ["2026-09-21T14:13:20Z", "2026-09-21T14:12:35Z"]


def test_kml_is_read_with_its_placemarks():
    document = KML.from_string(kml([TARGET], [VEHICLE]).decode().partition("?>")[2])
    (folder,) = document.features
    names = [placemark.name for placemark in folder.features]
    assert names == ["<a & b> 1/4", "vehicle 1"]
    assert folder.features[1].time_stamp.dt.isoformat() == "2026-09-21T14:12:35+00:00"


def test_xml_is_well_formed_whatever_a_label_holds():
    label = "".join(map(chr, range(32))) + "\x7f\ufffe]]><b>"
    spoiled, vehicle = (
        msgspec.structs.replace(TARGET, label=label, id=label),
        msgspec.structs.replace(VEHICLE, id=label),
    )
    ET.fromstring(kml([spoiled], [vehicle]))
    ET.fromstring(one_document(cot_events([spoiled], 10**18, "", vehicles=[vehicle], geoid=lambda *_: 0.0)))


def test_csv_has_one_row_a_target_and_no_formula():
    dangerous = TargetView(
        id="1/5",
        vehicle="1",
        label="=cmd()",
        state="lost",
        lat=-1.0,
        lon=2.0,
        first_unix=0.0,
        seen_unix=0.0,
        source="x",
    )
    rows = list(csv.DictReader(io.StringIO(csv_table([TARGET, dangerous]).decode())))
    assert rows[0]["label"] == "<a & b>"
    assert float(rows[0]["radius95_m"]) == 2.7
    assert rows[1]["label"] == "'=cmd()"
    assert float(rows[1]["lat"]) == -1.0


def test_cursor_on_target_has_one_sigma_and_what_is_lost_until_it_is_stale():
    now = 1_790_000_000
    lost = {"vehicle": "1", "state": "lost", "lat": 0.0, "lon": 0.0, "first_unix": 0.0, "source": "x"}
    views = [TARGET, TargetView(id="2", seen_unix=now - 600, **lost), TargetView(id="3", seen_unix=now - 3601, **lost)]
    views = [msgspec.structs.replace(views[0], seen_unix=now), *views[1:]]
    events = cot_events(views, now * 10**9, "unit")
    assert [complaints(event) for event in events] == [[], []]
    root = ET.fromstring(one_document(events))
    assert [each.get("uid").rpartition(".")[2] for each in root] == [TARGET.id, "2"]
    point = root[0].find("point")
    assert float(point.get("ce")) == pytest.approx(3.0 / 2.4477, abs=0.01)
    assert (float(point.get("lat")), float(point.get("hae"))) == (48.1, 9_999_999.0)
    assert root[0].get("time") == "2026-09-21T14:13:20.000Z"
    assert root[1].get("stale") == "2026-09-21T15:03:20.000Z"
    assert "last seen 14:03 UTC" in root[1].findtext("detail/remarks")


def test_cursor_on_target_has_vehicles_and_heights_by_the_geoid():
    utc_s, place = 1_790_000_000, {"position": 1_790_000_000.0 - 4.0}
    heard = VehicleView(
        id="7", heard_unix=0.0, heard=place, lat=48.1, lon=11.5, alt_amsl=500.0, heading_deg=90.0, speed_m_s=4.0
    )
    silent = VehicleView(id="8", heard_unix=utc_s, heard={"position": utc_s - 10.0}, lat=48.1, lon=11.5)
    (event,) = cot_events([], utc_s * 10**9, "unit", vehicles=[heard, silent], geoid=lambda _lat, _lon: 45.5)
    assert complaints(event) == []
    root = ET.fromstring(event)
    assert (root.get("type"), root.find("point").get("hae")) == ("a-f-A-M", "545.50")
    assert root.find("detail/track").attrib == {"course": "90.0", "speed": "4.0"}
    assert root.get("time") == "2026-09-21T14:13:16.000Z"  # that of its place
