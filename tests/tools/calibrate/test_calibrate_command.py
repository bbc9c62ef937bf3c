"""`calibrate` as a new user runs it, on pictures that the tests drew."""

import json
import subprocess
import sys

import cv2
import numpy as np
import pytest
from drawn_boards import PAPER, half_size
from draws import first_of
from frozen import hold, keys

from fwav_companion.camera import parse_calibration
from fwav_companion.cli.calibrate_output import report_failure
from fwav_companion.cli.main import main
from fwav_companion.tools.calibrate.board_finders import ChessboardFinder, finder_of
from fwav_companion.tools.calibrate.board_spec import parse_board
from fwav_companion.tools.calibrate.board_views import BoardSearch
from fwav_companion.tools.calibrate.calibration_summary import picture_rows
from fwav_companion.tools.calibrate.lens_comparison import lens_difference
from fwav_companion.tools.calibrate.lens_fit.lens_fit import FailedFit, FitFailure
from fwav_companion.tools.calibrate.lens_fit.outliers import DroppedView
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView

BOARD = "chessboard:7x5:25mm"


def calibrate(folder, out, *words, board=BOARD):
    return main(["calibrate", str(folder), "--board", board, "--out", str(out), *words])


@pytest.fixture(scope="module")
def calibrated(chess_folder, tmp_path_factory):
    """(printed output, output folder) of the command in a shell of its own."""
    folder = tmp_path_factory.mktemp("calibrated")
    words = ["--board", BOARD, "--out", "camera.yaml", "--report", "report", "--json"]
    command = [sys.executable, "-m", "fwav_companion", "calibrate", str(chess_folder), *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    *said, last = done.stdout.splitlines()
    return folder, "\n".join(said), json.loads(last)


def test_the_file_is_the_lens_that_drew_the_pictures(calibrated):
    folder, _, reported = calibrated
    lens = parse_calibration((folder / "camera.yaml").read_text(), "camera.yaml").lens
    truth = half_size(PAPER)
    k, middle = [c / truth.c[0] for c in truth.c], list(truth.centre)
    text = f"model: kannala_brandt\nimage_size: [320, 240]\nk_mm: {k}\nprincipal_point: {middle}\n"
    drew = parse_calibration(f"{text}pixels_per_mm: [{truth.c[0]}, {truth.c[0]}]\n", "truth").lens
    apart, claimed = lens_difference(lens, drew), reported["rays"][-1]
    assert np.degrees(apart.rms) < 3.0 * claimed["sigma_deg"] < 1.5
    assert np.degrees(apart.rms_without_rotation) < 3.0 * claimed["sigma_mount_known_deg"] < 0.6


def test_it_says_of_what_and_how_good(calibrated, chess_folder):
    folder, said, reported = calibrated
    text = (folder / "camera.yaml").read_text()
    for line in (
        "12 pictures of 320 x 240",
        "focal length",
        "reprojection error, RMS: 0.",
        "one sigma of a ray at",
        "r = k1 θ",
    ):
        assert line in said
        assert line in text
    assert "wrote camera.yaml" in said
    assert "pixel_noise_px" in said
    assert reported["ok"] is True
    assert reported["noise_px"] < 0.15
    used = [row for row in reported["pictures"] if row["used"]]
    assert len(reported["pictures"]) == len(list(chess_folder.iterdir()))
    assert len(used) == len([row for row in reported["pictures"] if row["corners"]]) >= 7
    assert all(row["why"].startswith("cut off: ") for row in reported["pictures"] if not row["used"])


def test_it_ends_with_a_verdict(calibrated):
    folder, said, reported = calibrated
    verdict = next(line for line in said.splitlines() if line.startswith("verdict: "))
    assert verdict in (folder / "camera.yaml").read_text()
    assert verdict.startswith(f"verdict: {reported['verdict']}")
    assert reported["verdict"] in ("good", "usable")
    assert said.splitlines()[-1] in (verdict, *(f"  - {remedy}" for remedy in reported["take"]))
    assert 20.0 < reported["usable_deg"] < 35.0


def test_the_reprojection_error_is_opencvs(calibrated):
    """OpenCV's own calibration of the same pictures by the same model reports the same RMS, to a tenth."""
    *_, reported = calibrated
    used = [row["name"] for row in reported["pictures"] if row["used"]]
    places = np.stack(np.meshgrid(np.arange(7), np.arange(5)), axis=-1).reshape(1, -1, 2) * 0.025
    pixels = [finder_of(parse_board(BOARD)).find(cv2.imread(name, cv2.IMREAD_GRAYSCALE))[1] for name in used]
    board = [np.concatenate([places, np.zeros((1, 35, 1))], axis=2)] * len(used)
    K, D = np.array([[333.0, 0.0, 160.0], [0.0, 333.0, 120.0], [0.0, 0.0, 1.0]]), np.zeros((4, 1))
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW | cv2.CALIB_USE_INTRINSIC_GUESS
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    corners = [each.reshape(1, -1, 2) for each in pixels]
    rms, *_ = cv2.fisheye.calibrate(board, corners, (320, 240), K, D, flags=flags, criteria=stop)
    assert reported["reprojection_rms_px"] == pytest.approx(rms, rel=0.1)


@pytest.mark.parametrize("noise_px", first_of(0.9, 0.05))
def test_a_poor_calibration_is_written_with_its_verdict_and_ends_with_1(
    noise_px, chess_folder, tmp_path, monkeypatch, capsys
):
    """Displace every corner of the finder by ``noise_px``."""
    rng = np.random.default_rng(4)

    def find(finder, picture):
        found = whole(finder, picture)
        return found and (found[0], found[1] + rng.normal(0.0, noise_px, found[1].shape))

    whole = ChessboardFinder.find
    monkeypatch.setattr(ChessboardFinder, "find", find)
    status = calibrate(chess_folder, tmp_path / "camera.yaml", "--json")
    shown = capsys.readouterr()
    reported = json.loads(shown.out.splitlines()[-1])
    poor = noise_px > 0.5
    assert (status, reported["ok"], reported["verdict"] == "poor") == (int(poor), not poor, poor)
    assert ("Take these pictures and calibrate again:" in shown.out) == poor
    assert f"# verdict: {reported['verdict']}" in (tmp_path / "camera.yaml").read_text()
    assert shown.err == ""


def test_the_keys_for_scripts(calibrated):
    hold("calibrate", keys([calibrated[-1]], "calibrate"))


def test_it_draws_how_good(calibrated):
    folder, said, _ = calibrated
    picture = cv2.imread(str(folder / "report" / "calibration.png"))
    assert picture.shape[0] > 500
    assert picture.std() > 10.0
    assert "calibration.png" in said


def test_nothing_is_written_over_without_a_word(calibrated, chess_folder, tmp_path, capsys):
    out = tmp_path / "camera.yaml"
    out.write_text("mine")
    assert calibrate(chess_folder, out) == 2
    assert f"{out}: exists already; accepted: another name, or --overwrite" in capsys.readouterr().err
    assert out.read_text() == "mine"
    old = calibrated[0] / "camera.yaml"
    assert calibrate(chess_folder, out, "--overwrite", "--compare", str(old), "--json") == 0
    reported = json.loads(capsys.readouterr().out.splitlines()[-1])
    same, unread = reported["compared"]
    assert same["rms_deg"] < 1e-6
    assert "not_compared" in unread
    assert parse_calibration(out.read_text(), "camera.yaml").lens.image_size == (320, 240)


def test_a_picture_is_not_overwritten_by_the_camera_made_of_it(chess_folder, tmp_path, capsys):
    picture = tmp_path / "1.png"
    picture.write_bytes((chess_folder / "00.png").read_bytes())
    assert calibrate(picture, picture, "--overwrite") == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert picture.read_bytes() == (chess_folder / "00.png").read_bytes()


def test_too_few_pictures_are_reported_after_the_table(chess_folder, tmp_path, capsys):
    assert calibrate(chess_folder / "00.png", tmp_path / "camera.yaml", "--json") == 2
    shown = capsys.readouterr()
    assert "00.png" in shown.out
    assert shown.err == (
        "fwav-companion: calibrate: too few pictures: the board is seen in 1; at least 5 are needed, 15 are good\n"
    )
    assert json.loads(shown.out.splitlines()[-1])["ok"] is False
    assert not (tmp_path / "camera.yaml").exists()


def test_what_fits_no_lens_is_a_bad_result_and_not_a_wrong_input(capsys):
    misfit = FailedFit(FitFailure.MISFIT, "the reprojection error is 9.0 px")
    search = BoardSearch(size=(320, 240), views=(), missing={}, repeated={}, blurred={})
    assert report_failure(misfit, search, [], as_json=True) == 1
    shown = capsys.readouterr()
    assert json.loads(shown.out) == {"ok": False, "why": f"{FitFailure.MISFIT.value}: {misfit.detail}", "pictures": []}
    assert shown.err == "nothing is written: no lens of this model fits: the reprojection error is 9.0 px\n"


def test_a_dropped_picture_that_is_blurred_is_called_so():
    dropped = DroppedView("1.png", "its reprojection error is 4 times the usual one", 0.9)
    view = BoardView("1.png", np.zeros((35, 2)), np.zeros((35, 2)))
    search = BoardSearch(size=(320, 240), views=(view,), missing={}, repeated={}, blurred={"1.png": 8.6})
    (row,) = picture_rows(["1.png"], search, FailedFit(FitFailure.MISFIT, "", (dropped,)))
    assert row.why == "its reprojection error is 4 times the usual one; blurred: its edges are 9 px wide"


def test_a_wrong_count_is_reported_with_the_right_one(chess_folder, tmp_path, capsys):
    assert calibrate(chess_folder / "00.png", tmp_path / "camera.yaml", board="chessboard:8x6:25mm") == 2
    assert (
        "seen in part: 7x5 of its 8x6 inner corners are in the picture: the rest is covered, or --board counts squares"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none", "--board", BOARD, "--out", "o.yaml"], "none: No such file"),
        (["PICTURES", "--board", "chess", "--out", "o.yaml"], "--board 'chess': accepted: chessboard:9x6:25mm"),
        (["PICTURES", "--out", "o.yaml"], "--board"),
        (["PICTURES", "--board", BOARD], "--out"),
        (["PICTURES", "--board", BOARD, "--out", "none/o.yaml"], "none: no such folder"),
        (["PICTURES", "--board", BOARD, "--out", "."], "exists already"),
        (["PICTURES", "--board", BOARD, "--out", "o.yaml", "--compare", "none.yaml"], "none.yaml: No such file"),
        (["PICTURES", "--board", BOARD, "--out", "o.yaml", "--compare", "PICTURES/00.png"], "00.png: byte 0 is not"),
        (["--board", BOARD, "--out", "o.yaml"], "IMAGES"),
    ],
)
def test_what_is_wrong_is_one_line(words, said, chess_folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", *(word.replace("PICTURES", str(chess_folder)) for word in words)]) == 2
    shown = capsys.readouterr()
    assert shown.err.startswith("fwav-companion: ")
    assert shown.err.count("\n") == 1
    assert said in shown.err
    assert list(tmp_path.iterdir()) == []


def test_the_help_shows_boards_and_an_example(capsys):
    with pytest.raises(SystemExit):
        main(["calibrate", "--help"])
    shown = capsys.readouterr().out
    for word in ("chessboard:9x6:25mm", "charuco:7x5:30mm:22mm:DICT_4X4_50", "aprilgrid:", "example:", "inner corners"):
        assert word in shown
