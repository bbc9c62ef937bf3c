"""``demo --click``, as a user runs it."""

from __future__ import annotations

import json

import pytest

from fwav_companion.cli.main import main
from fwav_companion.tools.click_flight import click_demonstration


@pytest.mark.slow
def test_a_click_is_followed_and_the_same_seed_gives_the_same_flight(tmp_path, capsys):
    results = []
    for run in range(2):
        status = main(["demo", "--click", "--seed", "3", "--out", str(tmp_path / f"out{run}"), "--json"])
        results.append(json.loads(capsys.readouterr().out.splitlines()[-1]))
        assert status == 0
    assert results[0] == results[1]
    result = results[0]
    assert result["ok"] is True
    assert result["sharp_found"] >= 0.8 * result["sharp"] > 2
    assert result["passes"] >= 2
    assert result["added95_m"] < 0.2
    page = (tmp_path / "out0" / "report.html").read_text()
    assert "A click, followed" in page
    assert page.count("data:image/jpeg") == 3


@pytest.mark.slow
def test_a_spot_that_is_taken_for_another_is_exit_status_1(tmp_path, capsys, monkeypatch):
    """The tracker that is asked for a place 60 px away follows what is there."""
    real = click_demonstration.ClickedFlight._follow

    def elsewhere(self, order, now):
        import msgspec

        view = msgspec.structs.replace(order.view, at=(order.view.at[0] + 60.0, order.view.at[1]))
        real(self, msgspec.structs.replace(order, view=view), now)

    monkeypatch.setattr(click_demonstration.ClickedFlight, "_follow", elsewhere)
    status = main(["demo", "--click", "--seed", "3", "--seconds", "14", "--out", str(tmp_path / "out")])
    assert status == 1
    assert "demo: " in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--seconds", "5"], ["--fleet", "2"]])
def test_what_does_not_go_with_a_click_is_refused(tmp_path, capsys, words):
    assert main(["demo", "--click", "--out", str(tmp_path / "out"), *words]) == 2
    assert "accepted" in capsys.readouterr().err
