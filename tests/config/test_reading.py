"""Every configuration error: one line with the file, the key, its value, and the accepted values."""
# ruff: noqa: E501  # tables whose rows hold whole error lines

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.config import Config, parse
from fwav_companion.errors import ConfigError
from fwav_companion.types import Pad, PadTag

LINK = '[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:14550"\nrole = "autopilot"\n'
BASE = f'camera.calibration = "camera.yaml"\n{LINK}'
PAD_ALONE = '[[pad]]\nlabel = "p"\n'
PAD = f"{BASE}{PAD_ALONE}"


def error_of(text: str, *overrides: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse(text, "f.toml", overrides)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_an_empty_relay_file_has_every_default():
    config = parse('[detections]\nurl = ""', "f.toml")
    assert config.vehicle.component_id == 191
    assert config.signing is None
    assert config.vision is None
    assert config.link == ()
    assert not config.localizes


def test_pad_with_a_small_tag_in_the_blank_of_a_large_one_is_accepted():
    tags = '{ label = "a", size_m = 0.4, yaw_deg = 90 }, { label = "b", size_m = 0.08 }'
    config = parse(f"{PAD}landing_offset_m = [-2, 0.5]\nheight_m = 0.3\ntags = [{tags}]\n", "f.toml")
    large, small = PadTag(label="a", size_m=0.4, yaw_deg=90.0), PadTag(label="b", size_m=0.08)
    assert config.pad == (Pad(label="p", height_m=0.3, landing_offset_m=(-2.0, 0.5), tags=(large, small)),)


def test_values_are_taken_as_they_stand():
    config = parse(
        f"{BASE}max_rate_hz = {{ ATTITUDE = 4 }}\n[camera.mount]\nposition_m = [1, 2.5, -3]\n[signing]\n", "f.toml"
    )
    assert config.link[0].max_rate_hz == {"ATTITUDE": 4.0}
    assert config.camera.mount.lever_arm_m == (1.0, 2.5, -3.0)
    assert config.signing is not None
    assert config.signing.key_file == "signing.key"


@pytest.mark.parametrize(
    ("url", "keys", "bytes_per_s"),
    [
        ("udpin://127.0.0.1:14550", "", 0.0),
        ("udpin://127.0.0.1:14550", "max_bytes_per_s = 4000", 4000.0),
        ("serial:///dev/ttyUSB0:57600", "", 4032.0),
        ("serial:///dev/ttyUSB0:57600", "max_bytes_per_s = 1500", 1500.0),
        ("serial://0403:6001:115200", "", 8064.0),
    ],
)
def test_a_links_budget_is_seventy_percent_of_a_serial_line_where_the_file_says_nothing(url, keys, bytes_per_s):
    config = parse(f'[detections]\nurl = ""\n[[link]]\nname = "a"\nurl = "{url}"\nrole = "gcs"\n{keys}\n', "f.toml")
    assert config.link[0].byte_budget == pytest.approx(bytes_per_s)


def test_requests_for_rates_are_merged_on_ground_links_where_the_file_says_nothing():
    ground = '[[link]]\nname = "g{0}"\nurl = "udpin://127.0.0.1:1455{0}"\nrole = "gcs"\n'
    text = f"{BASE}{ground.format(1)}{ground.format(2)}forward_rate_requests = true\n"
    config = parse(text, "f.toml")
    assert [link.forward_rate_requests for link in config.link][1:] == ["merge", True]


# File content: the complete error line that it gives.
FAULTS = {
    "near key": (f"{BASE}[publish]\nrate_h = 3\n", '[publish] rate_h = 3: unknown key; did you mean "rate_hz"?'),
    "near table": ("[grund]\n", '[grund]: unknown key; did you mean "ground"?'),
    "key of another table": (f"{BASE}[ground]\nalpha = 3\n", "[ground] alpha = 3: unknown key here; did you mean it in [tracking]?"),
    "key of nothing": ("[rates]\nzzz = 3\n", "[rates] zzz = 3: unknown key; accepted keys: attitude, position"),
    "near key of a link": (LINK + 'rol = "gcs"\n', '[[link]] 1 "a" rol = "gcs": unknown key; did you mean "role"?'),
    "missing url": ('[[link]]\nname = "b"\nrole = "gcs"\n', '[[link]] 1 "b" url: missing; accepted: serial:///dev/NAME:BAUD | serial://VID:PID:BAUD | udpin:// | udpout:// | udpbcast:// | tcpin:// | tcpout://HOST:PORT'),
    "missing key": ('[[link]]\nname = "b"\nurl = "tcpin://[::1]:5"\n', '[[link]] 1 "b" role: missing; accepted: "autopilot" | "gcs" | "payload"'),
    "choice": ('[camera]\nstamp = "row1"\n', '[camera] stamp = "row1": accepted: "auto" | "row0_end" | "row0_mid" | "row0_start"'),
    "type": ('[vehicle]\nsystem_id = "one"\n', '[vehicle] system_id = "one": accepted: an integer from 0 to 255'),
    "a boolean is no number": ("[rates]\nattitude = true\n", "[rates] attitude = true: accepted: a number, above 0 and at most 1000"),
    "a date is no text": ("[record]\ndirectory = 2026-01-01\n", "[record] directory = datetime.date(2026, 1, 1): accepted: a text"),
    "range": ("[vehicle]\ncomponent_id = 1\n", "[vehicle] component_id = 1: accepted: an integer from 2 to 255"),
    "not finite": ("[ground]\nheight_m = nan\n", "[ground] height_m = nan: not finite; accepted: a number, above 0"),
    "beyond all": ("[ground]\nheight_m = 1e200\n", "[ground] height_m = 1e+200: beyond 1e+09; accepted: a number, above 0"),
    "of many digits": (f"[ground]\nheight_m = 1{'0' * 400}\n", f"[ground] height_m = 1{'0' * 76}...: beyond 1e+09; accepted: a number, above 0"),
    "a zero byte": ('[camera]\ncalibration = "a\\u0000b"\n', "[camera] calibration = \"a?b\": contains a zero byte; accepted: a text"),
    "nothing known": (
        "[uncertainty]\nheight_noise_m = 1e6\n",
        "[uncertainty] height_noise_m = 1000000.0: accepted: a number from 0 to 10000",
    ),
    "infinite in a list": ("[camera.mount]\nposition_m = [0, 0, inf]\n", "[camera.mount] position_m = [0, 0, inf]: not finite; accepted: a list of 3: each a number"),
    "too short": ("[camera.mount]\nposition_m = [0, 0]\n", "[camera.mount] position_m = [0, 0]: accepted: a list of 3: each a number"),
    "number or word": ('[camera]\nreadout_s = "fast"\n', '[camera] readout_s = "fast": accepted: "unknown" | a number from -1 to 1'),
    "neither merged nor passed nor stopped": (LINK + 'forward_rate_requests = "merg"\n', '[[link]] 1 "a" forward_rate_requests = "merg": accepted: "merge" | true | false'),
    "a number for a choice": (LINK + "forward_rate_requests = 1\n", '[[link]] 1 "a" forward_rate_requests = 1: accepted: "merge" | true | false'),
    "less than no bytes": (LINK + "max_bytes_per_s = -1\n", '[[link]] 1 "a" max_bytes_per_s = -1: accepted: a number, 0 or more'),
    "rate of a message": (LINK + "max_rate_hz = { ATTITUDE = 0 }\n", "[[link]] 1 \"a\" max_rate_hz = {'ATTITUDE': 0}: accepted: a table, each key a message name, as ATTITUDE, each value a number, above 0"),
    "no table": ("vehicle = 3\n", "vehicle = 3: accepted: a table"),
    "no list of tables": ("link = 3\n", "link = 3: accepted: tables, each headed [[link]]"),
    "not TOML": ("[vehicle]\nsystem_id = = 1\n", 'line 2: "system_id = = 1": Invalid value (at line 2, column 13); accepted: TOML 1.0'),
    "quotes": (LINK.replace('"autopilot"', "gcs"), 'line 4: "role = gcs": accepted: role = "gcs" (a text in quotes)'),
    "quotes of a URL": ("[[link]]\nurl = udpin://0.0.0.0:14550 # all\n", 'line 2: "url = udpin://0.0.0.0:14550 # all": accepted: url = "udpin://0.0.0.0:14550" (a text in quotes)'),
    "quotes of a device": ("[[link]]\nurl = /dev/ttyAMA0\n", 'line 2: "url = /dev/ttyAMA0": accepted: url = "/dev/ttyAMA0" (a text in quotes)'),
    "quotes of two words": ("[publish]\nlabel = landing pad\n", 'line 2: "label = landing pad": accepted: label = "landing pad" (a text in quotes)'),
    "a capital": ("[tracking]\nself_calibration = True\n", 'line 2: "self_calibration = True": accepted: self_calibration = true (true or false, in lower case)'),
    "no for false": ("[publish]\nadsb = No\n", 'line 2: "adsb = No": accepted: adsb = false (true or false, in lower case)'),
    "a decimal comma": ("[camera]\nreadout_s = 0,0174  # s\n", 'line 2: "readout_s = 0,0174  # s": accepted: readout_s = 0.0174 (a decimal point)'),
    "a unit": ("[ground]\nheight_m = 0.5 m # low\n", 'line 2: "height_m = 0.5 m # low": accepted: height_m = 0.5 (a number alone)'),
    "a unit without a gap": ("[camera]\ntime_offset_s = 0.03s\n", 'line 2: "time_offset_s = 0.03s": accepted: time_offset_s = 0.03 (a number alone)'),
    "no digit before the point": ("[ground]\nheight_m = -.5\n", 'line 2: "height_m = -.5": accepted: height_m = -0.5 (a digit before the point)'),
    "no digit after the point": ("[ground]\nheight_m = 5.\n", 'line 2: "height_m = 5.": accepted: height_m = 5.0 (a digit after the point)'),
    "a port of two links": (LINK + '[[link]]\nname = "b"\nurl = "udpin://0.0.0.0:14550"\nrole = "gcs"\n', '[[link]] 2 "b" url = "udpin://0.0.0.0:14550": [[link]] "a" opens this already; accepted: a port or device of its own'),
    "a device of two links": ((LINK + LINK.replace('"a"', '"b"')).replace("udpin://127.0.0.1:14550", "serial:///dev/ttyAMA0:57600"), '[[link]] 2 "b" url = "serial:///dev/ttyAMA0:57600": [[link]] "a" opens this already; accepted: a port or device of its own'),
    "the detections' port": (BASE.replace("14550", "14601"), '[detections] url: [[link]] "a" opens udpin://127.0.0.1:14601 already; accepted: a port or device of its own'),
    "a table twice": ("[ground]\nheight_m = 1\n\n[ground] # again\nmodel = 'fixed'\n", 'line 4: "[ground] # again": this table is there already in line 1; accepted: each table once, with all its keys'),
    "a key twice": ("[publish]\nadsb = true\nadsb = true\n", 'line 3: "adsb = true": its table has this key already; accepted: each key once in its table'),
    "a table for tables": ("[link]\nname = 'a'\n[link]\nname = 'b'\n", 'line 3: "[link]": accepted: [[link]], once for each'),
    "a table after tables": ("[[link]]\nname = 'a'\n[link]\nname = 'b'\n", 'line 3: "[link]": accepted: [[link]], once for each'),
    "nothing known of the line": ("[ground]\nheight_m = 05\n", 'line 2: "height_m = 05": Expected newline or end of document after a statement (at line 2, column 13); accepted: TOML 1.0'),
    "a boolean in quotes": ('[publish]\nadsb = "True"\n', '[publish] adsb = "True": accepted: true | false; write true in lower case, without quotes'),
    "a number in quotes": ('[ground]\nheight_m = "0,5"\n', '[ground] height_m = "0,5": accepted: a number, above 0; write 0.5 with a decimal point, without quotes'),
    "a number for unknown": ('[camera]\nreadout_s = "0.0174"\n', '[camera] readout_s = "0.0174": accepted: "unknown" | a number from -1 to 1; write 0.0174, without quotes'),
    "MAVSDK's udp": (BASE.replace("udpin://127.0.0.1:14550", "udp://:14540"), '[[link]] 1 "a" url = "udp://:14540": "udp://" is not a kind of link; did you mean udpin:// (listens) or udpout:// (sends)? accepted: serial:///dev/NAME:BAUD | serial://VID:PID:BAUD | udpin:// | udpout:// | udpbcast:// | tcpin:// | tcpout://HOST:PORT'),
    "MAVSDK's tcp": (BASE.replace("udpin://127.0.0.1:14550", "tcp://10.0.0.2:5760"), '[[link]] 1 "a" url = "tcp://10.0.0.2:5760": "tcp://" is not a kind of link; did you mean tcpout:// (connects) or tcpin:// (listens)? accepted: serial:///dev/NAME:BAUD | serial://VID:PID:BAUD | udpin:// | udpout:// | udpbcast:// | tcpin:// | tcpout://HOST:PORT'),
    "no baud rate": (BASE.replace("udpin://127.0.0.1:14550", "/dev/ttyAMA0"), '[[link]] 1 "a" url = "/dev/ttyAMA0": it has no baud rate; did you mean serial:///dev/ttyAMA0:57600 or :921600? accepted: serial:///dev/NAME:BAUD | serial://VID:PID:BAUD'),
    "detections by udp": (f'{BASE}[detections]\nurl = "udp://:14601"\n', '[detections] url = "udp://:14601": did you mean udpin://? accepted: udpin://HOST:PORT | unix:///PATH'),
    "CoT by udp": (f'{BASE}[publish]\ncot = "udp://239.2.3.1:6969"\n', '[publish] cot = "udp://239.2.3.1:6969": did you mean udpout://? accepted: udpout://HOST:PORT | udpbcast://HOST:PORT | tcpout://HOST:PORT | tls://HOST:PORT'),
    "a dictionary": (f'{BASE}[vision]\naruco_dictionary = "4x5_50"\n', '[vision] aruco_dictionary = "4x5_50": accepted: "4x4_50" ... "7x7_1000": 4x4, 5x5, 6x6, 7x7 with 50, 100, 250, 1000 markers'),
    "url": (BASE.replace("udpin://127.0.0.1:14550", "udpin://:14550"), '[[link]] 1 "a" url = "udpin://:14550": it does not name a host; accepted: udpin://HOST:PORT (127.0.0.1 for this board alone, 0.0.0.0 for every network)'),
    "two links of one name": (BASE + LINK, '[[link]] 2 "a" name = "a": another [[link]] has this name; accepted: a name of its own'),
    "unsigned on no link": (f'{BASE}[signing]\naccept_unsigned = ["a", "b"]\n', '[signing] accept_unsigned[1] = "b": no [[link]] has this name; accepted: a'),
    "the camera's component": (f"{BASE}[vehicle]\ncomponent_id = 100\n", "[vehicle] component_id = 100: 100 is the camera component's while [publish] camera_tracking is on; accepted: another"),
    "landing on anything": (f"{BASE}[publish]\nlanding_target = true\n", "[publish] landing_label: missing, while [publish] landing_target is on; accepted: the label of the target to land on"),
    "no camera file": (LINK, '[camera] calibration: missing, while [detections] url brings pixels; accepted: the path of a camera file (for a relay alone: [detections] url = "")'),
    "no camera file for our own camera": ('[vision]\n[detections]\nurl = ""\n', '[camera] calibration: missing, while [vision] opens a camera; accepted: the path of a camera file (for a relay alone: [detections] url = "")'),
    "terrain of an untold datum": (f'{BASE}[ground]\nmodel = "terrain"\nterrain = ["a.hgt"]\n', "[ground] terrain_datum: missing, while [ground] terrain names files, which do not contain it; accepted: egm96, egm2008, ellipsoid"),
    "detections over TCP": (f'{BASE}[detections]\nurl = "tcpin://127.0.0.1:5"\n', '[detections] url = "tcpin://127.0.0.1:5": accepted: udpin://HOST:PORT | unix:///PATH'),
    "CoT to a file": (f'{BASE}[publish]\ncot = "events.xml"\n', '[publish] cot = "events.xml": accepted: udpout://HOST:PORT | udpbcast://HOST:PORT | tcpout://HOST:PORT | tls://HOST:PORT'),
    "an unknown kind of source": (f'{BASE}[vision]\nsource = "http://10.0.0.2/a?b=c&d"\n', '[vision] source = "http://10.0.0.2/a?b=c&d": unknown kind of source; accepted: libcamera:N | /dev/videoN | rtsp://HOST/PATH | udp://HOST:PORT (MPEG-TS) | a .sdp file (RTP) | a video file | a folder or pipe of pictures'),
    "a stream without a port": (f'{BASE}[vision]\nsource = "udp://0.0.0.0"\n', '[vision] source = "udp://0.0.0.0": no port; accepted: udp://HOST:PORT, as udp://0.0.0.0:5600'),
    "three sides of a picture": (f'{BASE}[vision]\nsize = [640, 480, 480]\n', "[vision] size = [640, 480, 480]: accepted: [] or [width, height], as [640, 480]"),
    "onnx without a model": (f'{BASE}[vision]\ndetector = "onnx"\n', '[vision] model: missing, while detector = "onnx"; accepted: the path of an .onnx file'),
    "pictures of no camera": (f"{BASE}[record]\npictures = 10\n", "[record] pictures = 10: there is no [vision], whose pictures would be kept; accepted: 0"),
    "pictures of another choice": (f'{BASE}[vision]\n[record]\npictures = "all"\n', '[record] pictures = "all": accepted: "detections" | an integer from 0 to 100000'),
    "a vehicle by the name of the fusion": (f'{BASE}[fleet]\nvehicle = "fleet"\n', '[fleet] vehicle = "fleet": the name of the targets that `ground` fuses; accepted: a name of its own'),
    "a preview for everyone": (f'{BASE}[vision]\npreview = "0.0.0.0:8089"\n', '[vision] preview = "0.0.0.0:8089": beyond loopback anyone may look; accepted: HOST:PORT/TOKEN with a token of 16 characters or more, or 127.0.0.1:PORT'),
    "two heights of one label": (f'{BASE}[[target]]\nlabel = "a"\nheight_m = 1.0\n[[target]]\nlabel = "a"\nheight_m = 2.0\n', '[[target]] 2 label = "a": another [[target]] has this label; accepted: a label of its own'),
    "a target of another motion": (f'{BASE}[[target]]\nlabel = "a"\nmotion = "moving"\n[tracking]\nfilter = "lowpass"\n', '[[target]] 1 motion = "moving": filter = "lowpass" takes all targets as [tracking] motion; accepted: "static"'),
    "a tag without an edge": (f'{BASE}[[target]]\nlabel = "a"\nsize_m = 0\n', "[[target]] 1 size_m = 0: accepted: a number, above 0 and at most 100"),
    "a pad without tags": (f'{BASE}[[pad]]\nlabel = "p"\ntags = []\n', "[[pad]] 1 tags = []: accepted: a list of at least one tag"),
    "a pad's tag without a size": (f'{PAD}tags = [{{ label = "a" }}]\n', "[[pad]] 1 tags[0] size_m: missing; accepted: a number, above 0 and at most 100"),
    "a pad's tag of no size": (f'{PAD}tags = [{{ label = "a", size_m = 0.0 }}]\n', "[[pad]] 1 tags[0] size_m = 0.0: accepted: a number, above 0 and at most 100"),
    "a pad's tag with another key": (f'{PAD}tags = [{{ label = "a", size = 0.1 }}]\n', '[[pad]] 1 tags[0] size = 0.1: unknown key; did you mean "size_m"?'),
    "one tag twice on a pad": (f'{PAD}tags = [{{ label = "a", size_m = 0.1 }}, {{ label = "a", size_m = 0.1, at_m = [1, 0] }}]\n', '[[pad]] 1 tags[1] label = "a": this [[pad]] has this tag already; accepted: each tag once'),
    "one tag on two pads": (f'{PAD}tags = [{{ label = "a", size_m = 0.1 }}]\n[[pad]]\nlabel = "q"\ntags = [{{ label = "a", size_m = 0.1 }}]\n', '[[pad]] 2 tags[0] label = "a": [[pad]] 1 has this tag already; accepted: each tag once'),
    "a pad's tag that is a target": (f'{PAD}tags = [{{ label = "a", size_m = 0.1 }}]\n[[target]]\nlabel = "a"\n', '[[pad]] 1 tags[0] label = "a": a [[target]] has this label; accepted: a tag that is of this pad alone'),
    "a pad's tag that is a landmark": (f'{PAD}tags = [{{ label = "a", size_m = 0.1 }}]\n[[landmark]]\nlabel = "a"\nlat = 48.1\nlon = 11.5\nalt_amsl = 519.0\n', '[[pad]] 1 tags[0] label = "a": a [[landmark]] has this label; accepted: a tag that is of this pad alone'),
    "two tags at one place": (f'{PAD}tags = [{{ label = "a", size_m = 0.1, at_m = [0.5, 0] }}, {{ label = "b", size_m = 0.15, at_m = [0.5, 0] }}]\n', "[[pad]] 1 tags[1] at_m = [0.5, 0]: a is at this place; accepted: a place of its own, or in another's blank with at most half of its size"),
    "two pads of one label": (f'{PAD}tags = [{{ label = "a", size_m = 0.1 }}]\n{PAD_ALONE}tags = [{{ label = "b", size_m = 0.1 }}]\n', '[[pad]] 2 label = "p": another [[pad]] has this label; accepted: a label of its own'),
    "a pad that is a target": (f'{PAD}tags = [{{ label = "a", size_m = 0.1 }}]\n[[target]]\nlabel = "p"\n', '[[pad]] 1 label = "p": a [[target]] has this label; accepted: a label of its own'),
    "a pad of another motion": (f'{PAD}motion = "moving"\ntags = [{{ label = "a", size_m = 0.1 }}]\n[tracking]\nfilter = "lowpass"\n', '[[pad]] 1 motion = "moving": filter = "lowpass" takes all targets as [tracking] motion; accepted: "static"'),
    "a target below the ground": (f'{BASE}[[target]]\nlabel = "a"\nheight_m = -1.0\n', "[[target]] 1 height_m = -1.0: accepted: a number from 0 to 1000"),
    "a key that breaks the line": ('"a\\nb" = 1\n', "a?b = 1: unknown key; accepted tables: vehicle, link, signing, rates, camera, detections, vision, target, pad, landmark, ground, uncertainty, tracking, publish, act, fleet, record, state, status"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_fault(name: str):
    text, expected = FAULTS[name]
    assert error_of(text) == f"f.toml: {expected}"


def test_a_long_value_is_shortened():
    message = error_of(f'[camera]\nstamp = "{"x" * 1000}"\n')
    assert "xxx...: accepted" in message
    assert len(message) < 200


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000, "[record]\nsync_s = 1" + "0" * 5000, "[record]\nsync_s = 1" + "0" * 500]
)
def test_monstrous_files_are_refused_in_one_line(text: str):
    assert error_of(text).startswith("f.toml: ")


def test_settings_are_laid_over_the_file():
    settings = ["tracking.filter=lowpass", "ground.height_m = 2.5", 'publish.label="a b"', "camera.mount.roll_deg=3"]
    config = parse(BASE, "f.toml", settings)
    assert config.tracking.filter == "lowpass"
    assert config.ground.height_m == 2.5
    assert config.publish.label == "a b"
    assert config.camera.mount.roll_deg == 3.0
    assert config.camera.calibration == "camera.yaml"


@pytest.mark.parametrize("text", ["4x4_50", "DICT_4X4_50", "dict_4x4_50", "Dict_4X4_50"])
def test_a_dictionary_may_be_written_as_opencv_has_it(text: str):
    config = parse(f'{BASE}[vision]\naruco_dictionary = "{text}"\n', "f.toml")
    assert config.vision is not None
    assert config.vision.aruco_dictionary == "4x4_50"
    by_setting = parse(f"{BASE}[vision]\n", "f.toml", [f"vision.aruco_dictionary={text}"])
    assert by_setting == config


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("tracking.filtre=lowpass", '--set: [tracking] filtre = "lowpass": unknown key; did you mean "filter"?'),
        ("tracking.filter=mean", '--set: [tracking] filter = "mean": accepted: "kalman" | "lowpass"'),
        ("tracking.self_calibration=True", '--set: [tracking] self_calibration = "True": accepted: true | false; write true in lower case, without quotes'),
        ("camera.readout_s=0,0174", '--set: [camera] readout_s = "0,0174": accepted: "unknown" | a number from -1 to 1; write 0.0174 with a decimal point, without quotes'),
        ("vision.aruco_dictionary=DICT_8X8_50", '--set: [vision] aruco_dictionary = "DICT_8X8_50": accepted: "4x4_50" ... "7x7_1000": 4x4, 5x5, 6x6, 7x7 with 50, 100, 250, 1000 markers'),
        ("rates.attitude", '--set: "rates.attitude": accepted: KEY=VALUE, as tracking.filter=lowpass'),
        ("=3", '--set: "=3": accepted: KEY=VALUE, as tracking.filter=lowpass'),
        ("rates.attitude=1\nx=3", '--set: "rates.attitude=1?x=3": accepted: KEY=VALUE with a TOML value, as ground.height_m=1.5'),
        ("link.url=udpin://127.0.0.1:1", '--set: "link.url=udpin://127.0.0.1:1": link is not a table; accepted: a key of a table'),
    ],
)  # fmt: skip
def test_a_wrong_setting_is_reported_as_one(setting: str, expected: str):
    assert error_of(BASE, setting) == expected


def test_a_fault_of_the_file_is_not_blamed_on_the_setting():
    assert error_of(BASE + "[rates]\nposition = -1\n", "rates.attitude=50").startswith("f.toml: [rates] position = -1")


toml_values = st.recursive(
    st.sampled_from(["1", "-1", "1e400", "nan", '"x"', "true", "2026-01-01", "1" * 30, '""']),
    lambda inner: st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]"),
    max_leaves=4,
)
toml_keys = st.sampled_from(
    ["link", "link.name", "camera", "camera.mount", "camera.mount.position_m", "signing", "vision", "zz", "rates.attitude", "detections.url", "detections.labels", "publish.cot_type"]
)  # fmt: skip


def outcome_of(text: str) -> Config | str:
    try:
        return parse(text, "f.toml")
    except ConfigError as error:
        return str(error)


@settings(max_examples=200, derandomize=True)
@given(st.dictionaries(toml_keys, toml_values, max_size=3))
def test_whatever_stands_there_gives_a_configuration_or_one_line(keys: dict[str, str]):
    outcome = outcome_of("\n".join(f"{key} = {value}" for key, value in keys.items()))
    assert isinstance(outcome, Config) or (outcome.startswith("f.toml: ") and "\n" not in outcome)
