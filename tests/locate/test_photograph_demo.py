"""`demo --photographs`: tags in drawn pictures are found within the claim; a wrong claim ends with 1."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fwav_companion.cli.main import main
from fwav_companion.tools.photograph_demo import photograph_demonstration


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_demo_of_photographs_finds_every_tag_within_its_claim(seed: int, tmp_path: Path, capsys):
    out = tmp_path / "out"
    assert main(["demo", "--photographs", "--seed", str(seed), "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert result["ok"] is True
    assert [each["id"] for each in result["targets"]] == [0, 1, 2, 3, 4]
    assert all(each["found"] and each["error_m"] < 1.0 for each in result["targets"])
    assert len(list(out.glob("*.JPG"))) == 6
    assert "tag36h11:4" in (out / "places.kml").read_text()


def test_demo_of_photographs_beyond_its_claim_ends_with_one(tmp_path: Path, monkeypatch, capsys):
    draw = photograph_demonstration.draw_photographs

    def draw_and_shift(out: Path, seed: int) -> None:
        draw(out, seed)
        truth = json.loads((out / "truth.json").read_text())
        truth["tags"][2]["lat"] += 2e-5
        (out / "truth.json").write_text(json.dumps(truth))

    monkeypatch.setattr(photograph_demonstration, "draw_photographs", draw_and_shift)
    assert main(["demo", "--photographs", "--out", str(tmp_path / "out")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "tag 2 is 2." in line


def test_two_demonstrations_at_once_are_refused(tmp_path: Path, capsys):
    assert main(["demo", "--photographs", "--click", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
