"""What `locate` writes: the place, and an altitude that is never without its datum."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest

from fwav_companion.cli.main import main
from sitl_mock.maker_tags import TruePicture
from tests.support.maker_pictures import place_below, true_picture, write_picture

KML = "{http://www.opengis.net/kml/2.2}"
PIXEL = (20.0, 18.0)
"""Of the stored 40 x 30; 100 times as large in the original."""


@pytest.fixture
def truth() -> TruePicture:
    """A camera above ground at 400 m, where the ellipsoid is 47 m below the sea level."""
    return true_picture(np.random.default_rng(2), lat=47.5, lon=11.5, pitch=-55.0)


def written(layout: str, truth: TruePicture, out: Path) -> tuple[str, tuple[float, float]]:
    """The file's text, and latitude and longitude of the true place."""
    path = write_picture(out.with_suffix(".jpg"), layout, truth)
    assert main(["locate", str(path), "--pixel", "{},{}".format(*PIXEL), "--out", str(out)]) == 0
    lat, lon, _ = place_below(truth, *((each + 0.5) * 100 - 0.5 for each in PIXEL))
    return out.read_text(), (lat, lon)


def point(text: str) -> Element:
    found = fromstring(text).find(f".//{KML}Point")
    assert found is not None
    return found


def test_kml_altitude_is_above_the_geoid_or_the_ground(truth: TruePicture, tmp_path: Path) -> None:
    text, (lat, lon) = written("dji_rtk", truth, tmp_path / "a.kml")
    assert point(text).findtext(f"{KML}altitudeMode") == "absolute"
    placed = [float(each) for each in str(point(text).findtext(f"{KML}coordinates")).split(",")]
    assert placed == pytest.approx([lon, lat, 400.0], abs=0.05)
    assert placed[:2] == pytest.approx([lon, lat], abs=5e-7)
    assert "400.0 m above sea level (EGM96)" in text
    assert "1 picture cannot show whether its errors" in text
    text, _ = written("dji_consumer", truth, tmp_path / "b.kml")
    assert point(text).findtext(f"{KML}altitudeMode") == "relativeToGround"
    assert "from the take-off" in text
    assert "sea level (EGM96)" not in text


def test_geojson_third_coordinate_is_above_the_ellipsoid_or_missing(truth: TruePicture, tmp_path: Path) -> None:
    text, (lat, lon) = written("dji_rtk", truth, tmp_path / "a.geojson")
    assert json.loads(text)["assumed"][-1].startswith("1 picture cannot show")
    feature = json.loads(text)["features"][0]
    assert feature["geometry"]["coordinates"] == pytest.approx([lon, lat, 400.0 + truth.undulation], abs=0.05)
    assert feature["properties"]["alt_datum"] == "egm96"
    assert feature["properties"]["alt_amsl"] == pytest.approx(400.0, abs=0.05)
    text, _ = written("dji_consumer", truth, tmp_path / "b.geojson")
    feature = json.loads(text)["features"][0]
    assert len(feature["geometry"]["coordinates"]) == 2
    assert feature["properties"]["alt_datum"] == "takeoff"
    assert (feature["properties"]["alt_amsl"], feature["properties"]["alt_hae"]) == (None, None)


def test_csv_row_names_the_datum_of_its_altitude(truth: TruePicture, tmp_path: Path) -> None:
    text, (lat, _) = written("dji_rtk", truth, tmp_path / "a.csv")
    (row,) = csv.DictReader(text.splitlines())
    assert float(row["lat"]) == pytest.approx(lat, abs=5e-7)
    assert (row["alt_datum"], float(row["alt_amsl"])) == ("egm96", pytest.approx(400.0, abs=0.05))
    text, _ = written("dji_consumer", truth, tmp_path / "b.csv")
    (row,) = csv.DictReader(text.splitlines())
    assert (row["alt_datum"], row["alt_amsl"], row["alt_hae"]) == ("takeoff", "", "")
    assert float(row["alt_takeoff"]) == pytest.approx(0.0, abs=0.05)
