"""The page's server over real HTTP: clicks are answered, saved at once and reopened; only its own page is answered."""

from __future__ import annotations

import asyncio
import http.client
import json
import threading
from contextlib import closing, contextmanager
from pathlib import Path

import cv2
import numpy as np
import pymap3d
import pytest

from fwav_companion.cli.main import main
from fwav_companion.errors import InputFileError
from tests.support.clicked_pictures import WIDTH, mark_place, write_set
from tests.support.processes import free_port

pytest.importorskip("aiohttp")

from fwav_companion.ground.access import AccessRules
from fwav_companion.tools.locate.photographs import CameraOptions, read_photographs
from fwav_companion.tools.locate.session import LocateOptions, LocateSession
from fwav_companion.tools.locate_page.board import ClickBoard
from fwav_companion.tools.locate_page.click_file import NAME, ClickFile
from fwav_companion.tools.locate_page.page_server import PAGE_FILES, LocateServer, LocateSettings
from fwav_companion.tools.locate_page.shelf import PhotographShelf, VideoShelf


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> list:
    return write_set(tmp_path_factory.mktemp("set"))


@pytest.fixture
def shelf(pictures) -> PhotographShelf:
    return PhotographShelf(read_photographs([path for path, _ in pictures], CameraOptions()))


def opened(shelf, folder: Path) -> ClickBoard:
    return ClickBoard(ClickFile(folder / NAME), shelf.photographs, lambda each: LocateSession(each, LocateOptions()))


@contextmanager
def served(board: ClickBoard, shelf, token: str = ""):
    port, ready = free_port(), threading.Event()
    loop, stop = asyncio.new_event_loop(), asyncio.Event()
    rules = AccessRules(host="127.0.0.1", port=port, token=token)
    settings = LocateSettings(version="1", clicks="c.csv", tiles=None, video_s=shelf.video_s)

    async def serve() -> None:
        server = LocateServer(board, shelf, rules, settings, None)
        await server.start()
        ready.set()
        await stop.wait()
        await server.close()

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()))
    thread.start()
    try:
        assert ready.wait(20.0)
        yield port
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(20.0)
        loop.close()


def ask(port: int, path: str, body: object = None, **headers: str) -> tuple[int, dict[str, str], bytes]:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)) as connection:
        given = {"Content-Type": "application/json"} | headers
        connection.request(
            "GET" if body is None else "POST", path, None if body is None else json.dumps(body), headers=given
        )
        response = connection.getresponse()
        return response.status, dict(response.getheaders()), response.read()


def distance_m(target: dict, name: str) -> float:
    north, east, _ = pymap3d.geodetic2ned(target["lat"], target["lon"], 0.0, *mark_place(name), 0.0)
    return float(np.hypot(north, east))


def click(pictures, number: int, name: str) -> dict:
    path, pixels = pictures[number]
    u, v = pixels[name]
    return {"file": path.name, "u": float(u), "v": float(v), "label": name}


def test_click_gives_the_place_and_where_it_should_be_in_the_other_pictures(pictures, shelf, tmp_path):
    with served(opened(shelf, tmp_path), shelf) as port:
        status, _, body = ask(port, "/click", click(pictures, 0, "car"))
        assert status == 200
        (target,) = json.loads(body)["answers"]["targets"]
        assert distance_m(target, "car") < 0.05
        expected = {each["file"]: (each["u"], each["v"]) for each in target["expected"]}
        assert expected.keys() == {path.name for path, _ in pictures[1:]}
        for path, pixels in pictures[1:]:
            assert expected[path.name] == pytest.approx(pixels["car"], abs=0.5)
        first = target["radius95_m"]
        (target,) = json.loads(ask(port, "/click", click(pictures, 2, "car"))[2])["answers"]["targets"]
        assert target["radius95_m"] < 0.7 * first
        assert len(target["pictures"]) == 2
        assert {each["file"] for each in target["expected"]} == {pictures[1][0].name, pictures[3][0].name}


def test_clicks_are_saved_at_once_and_reopened_and_the_command_line_reads_them(pictures, shelf, tmp_path, capsys):
    board = opened(shelf, tmp_path)
    board.click(*_click(pictures, 0, "car"))
    board.click(*_click(pictures, 1, "car"))
    board.click(*_click(pictures, 1, "barrel"))
    again = opened(shelf, tmp_path).state()  # the first board was never closed
    assert [(each.file, each.label) for each in again.clicks] == [
        (pictures[0][0].name, "car"), (pictures[1][0].name, "car"), (pictures[1][0].name, "barrel"),
    ]  # fmt: skip
    assert main(["locate", *(str(path) for path, _ in pictures), "--pixels", str(tmp_path / NAME), "--json"]) == 0
    targets = json.loads(capsys.readouterr().out.splitlines()[-1])["targets"]
    assert [each["label"] for each in targets] == ["car", "barrel"]
    assert targets[0]["lat"] == pytest.approx(again.answers.targets[0].lat, abs=1e-6)
    board.rename("car", "my car")
    board.remove("barrel")
    assert {each.label for each in opened(shelf, tmp_path).state().clicks} == {"my car"}


def _click(pictures, number: int, name: str) -> tuple:
    path, pixels = pictures[number]
    return path.name, (float(pixels[name][0]), float(pixels[name][1])), name


def test_click_without_a_place_is_named_and_the_others_are_answered(pictures, tmp_path):
    level = read_photographs([path for path, _ in pictures], CameraOptions(angles_deg=(0.0, -5.0, 0.0)))
    shelf = PhotographShelf(level)
    board = opened(shelf, tmp_path)
    board.click(pictures[0][0].name, (400.0, 20.0), "cloud")
    board.click(pictures[0][0].name, (400.0, 590.0), "road")
    state = board.state()
    assert [(each.pixel, each.reason) for each in state.without_place] == [((400.0, 20.0), "above_horizon")]
    assert [each.label for each in state.answers.targets] == ["road"]
    with served(board, shelf) as port:
        reasons = json.loads(ask(port, "/settings.json")[2])["reasons"]
        shown = json.loads(ask(port, "/state.json")[2])["without_place"]
    assert reasons[shown[0]["reason"]] == "it is above the horizon"


@pytest.mark.parametrize(
    ("path", "body", "said"),
    [
        ("/click", {"file": "other.jpg", "u": 1, "v": 1, "label": "a"}, "not among the pictures"),
        ("/click", {"file": "DJI_0000.JPG", "u": WIDTH, "v": 1, "label": "a"}, "outside its 800 x 600"),
        ("/click", {"file": "DJI_0000.JPG", "u": 1, "v": 1, "label": " "}, "characters"),
        ("/click", {"file": "DJI_0000.JPG", "u": 1, "v": 1, "label": "a" * 61}, "characters"),
        ("/click", {"file": "DJI_0000.JPG"}, "Bad Request"),
        ("/remove", [1], "Bad Request"),
        ("/rename", {"label": "a", "new": "\n"}, "characters"),
    ],
)
def test_bad_request_changes_nothing_and_is_one_line(shelf, tmp_path, path: str, body: object, said: str):
    board = opened(shelf, tmp_path)
    before = (tmp_path / NAME).read_bytes()
    with served(board, shelf) as port:
        status, _, text = ask(port, path, body)
    assert status == 400
    assert said in text.decode()
    assert text.count(b"\n") == 1
    assert (tmp_path / NAME).read_bytes() == before


def test_only_the_own_page_is_answered(pictures, shelf, tmp_path):
    with served(opened(shelf, tmp_path), shelf) as port:
        made = click(pictures, 0, "car")
        assert ask(port, "/state.json", Host="evil.example:80")[0] == 403
        assert ask(port, "/click", made, Origin="http://evil.example")[0] == 403
        assert ask(port, "/click", made, **{"Sec-Fetch-Site": "cross-site"})[0] == 403
        assert ask(port, "/click", made, **{"Content-Type": "text/plain"})[0] == 415
        assert json.loads(ask(port, "/state.json")[2])["clicks"] == []
        assert ask(port, "/click", made, Origin=f"http://127.0.0.1:{port}")[0] == 200
    with served(opened(shelf, tmp_path), shelf, token="secret") as port:
        assert ask(port, "/state.json")[0] == 403
        status, headers, _ = ask(port, "/?token=secret")
        assert status == 200
        assert ask(port, "/state.json", Cookie=headers["Set-Cookie"].partition(";")[0])[0] == 200


def test_pictures_and_page_files_are_served_and_nothing_else(pictures, shelf, tmp_path):
    path = pictures[0][0]
    with served(opened(shelf, tmp_path), shelf) as port:
        assert ask(port, f"/picture/{path.name}")[2] == path.read_bytes()
        small = cv2.imdecode(np.frombuffer(ask(port, f"/small/{path.name}")[2], np.uint8), cv2.IMREAD_COLOR)
        assert small.shape[:2] == (180, 240)
        for name in ("..%2f..%2fetc%2fpasswd", NAME, "%2fetc%2fpasswd"):
            assert ask(port, f"/picture/{name}")[0] == 404
        for name in PAGE_FILES:
            status, headers, body = ask(port, f"/page/{name}")
            assert (status, bool(body)) == (200, True)
            assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert ask(port, "/page/index.html")[0] == 404


@pytest.mark.parametrize("kind", ["kml", "geojson", "csv"])
def test_export_has_the_places(pictures, shelf, tmp_path, kind: str):
    board = opened(shelf, tmp_path)
    board.click(*_click(pictures, 0, "car"))
    with served(board, shelf) as port:
        status, headers, body = ask(port, f"/export/{kind}")
    assert status == 200
    assert f'filename="places.{kind}"' in headers["Content-Disposition"]
    assert str(mark_place("car")[0])[:7] in body.decode()


def test_clicks_of_other_pictures_are_refused_with_their_file(pictures, shelf, tmp_path):
    (tmp_path / NAME).write_text("file,u,v,label\nother.jpg,1,2,a\n")
    with pytest.raises(InputFileError, match=r"other\.jpg, which is not among the pictures"):
        opened(shelf, tmp_path)


def test_click_in_a_video_frame_adds_the_frame(tmp_path):
    path = tmp_path / "DJI_0001.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (160, 90))
    for brightness in range(30):
        writer.write(np.full((90, 160, 3), 8 * brightness, np.uint8))
    writer.release()
    path.with_suffix(".SRT").write_text(
        "".join(
            f"{at + 1}\n00:00:0{at},000 --> 00:00:0{at + 1},000\n[latitude: 47.0] [longitude: 11.0] [rel_alt: 40.0 "
            "abs_alt: 440.0] [focal_len: 240] [gb_yaw: 0.0 gb_pitch: -60.0 gb_roll: 0.0]\n\n"
            for at in range(3)
        )
    )
    shelf = VideoShelf(path, CameraOptions())
    board = opened(shelf, tmp_path)
    frames = len(shelf.photographs([]))
    board.click("DJI_0001.avi@1.000", (80.0, 45.0), "a")
    (target,) = board.state("DJI_0001.avi@2.000").answers.targets
    assert "DJI_0001.avi@2.000" in {each.file for each in target.expected}
    assert len(shelf.photographs(["DJI_0001.avi@1.000"])) == frames + 1
    _, jpeg = shelf.image("DJI_0001.avi@1.000", small=False)
    assert cv2.imdecode(np.frombuffer(jpeg, np.uint8), 0).mean() == pytest.approx(80.0, abs=9.0)
    for name in ("DJI_0001.avi@9.000", "other.avi@1.000", "DJI_0001.avi@x"):
        with pytest.raises(InputFileError, match="not a frame"):
            board.click(name, (80.0, 45.0), "a")
    assert opened(shelf, tmp_path).state().clicks[0].file == "DJI_0001.avi@1.000"


def test_expected_ellipse_holds_the_target_as_often_as_it_claims(pictures, shelf):
    """Monte Carlo of the click alone (other errors exact): its noise goes through the place into the other picture."""
    from fwav_companion.tools.locate.clicks import PictureClick
    from fwav_companion.tools.locate.heights import VerticalOptions
    from fwav_companion.tools.locate.world import Configured

    rng, sigma_px, inside, draws = np.random.default_rng(5), 3.0, 0, 400
    exact = Configured(position_bias_m=0.0, height_bias_m=0.0, mount_bias_deg=0.0, heading_bias_deg=0.0, terrain_m=0.0)
    session = LocateSession(
        shelf.photographs([]), LocateOptions(configured=exact, vertical=VerticalOptions(takeoff_alt_m=400.0))
    )
    import msgspec

    shots = [
        msgspec.structs.replace(shot, own_position_m=0.0, own_height_m=0.0, own_attitude=0.0)
        for shot in session.world.shots
    ]
    exact_sigmas = tuple(tuple(0.0 for _ in group) for group in session.world.shared_sigmas)
    session.world = msgspec.structs.replace(session.world, shots=tuple(shots), shared_sigmas=exact_sigmas)
    (first, truth), (other, seen) = pictures[0], pictures[1]
    for _ in range(draws):
        u, v = np.array(truth["car"]) + rng.normal(0.0, sigma_px, 2)
        answers = session.located([PictureClick(first.name, (float(u), float(v)), "car")], sigma_px, expected=True)
        (expected,) = (each for each in answers.targets[0].expected if each.file == other.name)
        outline = np.array(expected.outline, np.float32)
        inside += cv2.pointPolygonTest(outline, tuple(map(float, seen["car"])), False) >= 0
    # 99.9 % bounds of a binomial with p = 0.95
    assert abs(inside / draws - 0.95) < 3.3 * np.sqrt(0.95 * 0.05 / draws)


def test_http_with_a_pixel_is_refused_in_one_line(pictures, capsys):
    assert main(["locate", str(pictures[0][0]), "--http", "127.0.0.1:8090", "--pixel", "1,1"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["locate", str(pictures[0][0]), "--http", "8090"]) == 2
    assert "accepted: HOST:PORT" in capsys.readouterr().err
