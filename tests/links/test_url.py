"""Link URLs: every documented form, pymavlink's spellings, and the errors for all others."""

import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.links.url import (
    SerialUrl,
    TcpUrl,
    UdpUrl,
    UnixUrl,
    UrlError,
    parse_cot_url,
    parse_detections_url,
    parse_link_url,
)

BY_PATH = "/dev/serial/by-path/platform-3f980000.usb-usb-0:1.2:1.0-port0"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("serial:///dev/serial0:921600", SerialUrl(device="/dev/serial0", baud=921600)),
        (f"serial://{BY_PATH}:57600", SerialUrl(device=BY_PATH, baud=57600)),
        ("serial://1209:5741:115200", SerialUrl(vendor_id=0x1209, product_id=0x5741, baud=115200)),
        ("serial://0x26ac:0x0011:115200", SerialUrl(vendor_id=0x26AC, product_id=0x11, baud=115200)),
        ("udpin://0.0.0.0:14550", UdpUrl("udpin", "0.0.0.0", 14550)),
        ("udpout://ground.local:14550", UdpUrl("udpout", "ground.local", 14550)),
        ("udpbcast://192.168.1.255:14550", UdpUrl("udpbcast", "192.168.1.255", 14550)),
        ("udpin://[::1]:1", UdpUrl("udpin", "::1", 1)),
        ("udpout://[fe80::1%eth0]:65535", UdpUrl("udpout", "fe80::1%eth0", 65535)),
        ("tcpin://127.0.0.1:5760", TcpUrl("tcpin", "127.0.0.1", 5760)),
        ("tcpout://[2001:db8::1]:5760", TcpUrl("tcpout", "2001:db8::1", 5760)),
        ("udpin:127.0.0.1:14550", UdpUrl("udpin", "127.0.0.1", 14550)),
        ("udp:127.0.0.1:14550", UdpUrl("udpin", "127.0.0.1", 14550)),
        ("udpout:10.0.0.2:14550", UdpUrl("udpout", "10.0.0.2", 14550)),
        ("udpbcast:10.0.0.255:14550", UdpUrl("udpbcast", "10.0.0.255", 14550)),
        ("tcp:127.0.0.1:5760", TcpUrl("tcpout", "127.0.0.1", 5760)),
        ("tcpin:127.0.0.1:5760", TcpUrl("tcpin", "127.0.0.1", 5760)),
        ("/dev/ttyACM0,115200", SerialUrl(device="/dev/ttyACM0", baud=115200)),
    ],
)
def test_a_link(text: str, expected: object):
    assert parse_link_url(text) == expected
    assert parse_link_url(str(expected)) == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "accepted: serial:///dev/NAME:BAUD |"),
        ("http://127.0.0.1:80", '"http://" is not a kind of link; accepted: serial'),
        ("http://127.0.0.1:80", "; accepted: serial"),
        ("udp://:14540", '"udp://" is not a kind of link; did you mean udpin:// (listens) or udpout:// (sends)? acc'),
        ("udp://127.0.0.1:80", "did you mean udpin:// (listens) or udpout:// (sends)? accepted: serial"),
        ("tcp://127.0.0.1:5760", "did you mean tcpout:// (connects) or tcpin:// (listens)? accepted: serial"),
        ("UDPIN://127.0.0.1:80", "did you mean udpin://? accepted: serial"),
        ("serial:///dev/ttyS0", "it has no baud rate; did you mean serial:///dev/ttyS0:57600 or :921600?"),
        ("serial://1209:5741", "it has no baud rate; did you mean serial://1209:5741:57600 or :921600? accepted"),
        ("serial:///dev/ttyS0:fast", '"fast" is not a baud rate; accepted: 300 to 12000000'),
        ("serial:///dev/ttyS0:12", '"12" is not a baud rate'),
        ("serial:///dev/:9600", "it does not name a device"),
        ("serial://ttyS0:9600", '"ttyS0" is neither an absolute path nor VID:PID'),
        ("serial://12345:1:9600", '"12345:1" is neither'),
        ("/dev/ttyAMA0", "it has no baud rate; did you mean serial:///dev/ttyAMA0:57600 or :921600? accepted: serial"),
        ("/dev/ttyAMA0:57600", "did you mean serial:///dev/ttyAMA0:57600? accepted: serial"),
        ("/dev/ttyS0,", '"" is not a baud rate'),
        ("udpin://127.0.0.1", "it has no port; accepted: udpin://HOST:PORT"),
        ("udpin://127.0.0.1:0", '"0" is not a port; accepted: 1 to 65535'),
        ("udpin://127.0.0.1:65536", '"65536" is not a port'),
        ("udpin://127.0.0.1:+1", '"+1" is not a port'),
        ("udpin://127.0.0.1:\u0661", "is not a port"),
        ("udpin://:14550", "127.0.0.1 for this board alone"),
        ("udpout://:14550", "it does not name a host"),
        ("udpout://256.0.0.1:14550", '"256.0.0.1" is not a host'),
        ("udpout://1.2.3:14550", '"1.2.3" is not a host'),
        ("udpout://a b:14550", '"a b" is not a host'),
        ("udpout://a..b:14550", '"a..b" is not a host'),
        ("udpout://.ground:14550", '".ground" is not a host'),
        (f"udpout://{'a' * 64}.local:14550", '.local" is not a host'),
        (f"udpout://{'abc.' * 64}:14550", "is not a host"),
        (
            "udpout://::1:14550",
            '"::1" is not a host; accepted: a name, an IPv4 address, or an IPv6 address in [brackets]',
        ),
        ("udpout://[::g]:14550", '"[::g]" is not an IPv6 address'),
        ("udpout://[127.0.0.1]:14550", "is not an IPv6 address"),
        ("udpbcast://[ff02::1]:14550", "IPv6 has no broadcast"),
    ],
)
def test_no_link(text: str, said: str):
    with pytest.raises(UrlError) as caught:
        parse_link_url(text)
    assert said in str(caught.value)
    assert "accepted" in str(caught.value)


@pytest.mark.parametrize("host", ["ground", "ground.local", "ground.local.", "a" * 63 + ".local", "_x-1"])
def test_whatever_is_a_name_can_be_looked_up(host: str):
    """Python itself refuses an invalid name (by its idna codec), without an OSError."""
    assert parse_link_url(f"udpout://{host}:14550") == UdpUrl("udpout", host, 14550)
    assert host.encode("idna")


def test_where_detections_arrive():
    assert parse_detections_url("unix:///run/fwav-companion/detections") == UnixUrl("/run/fwav-companion/detections")
    assert parse_detections_url("udpin://127.0.0.1:14601") == UdpUrl("udpin", "127.0.0.1", 14601)
    assert parse_detections_url("udpin:127.0.0.1:14601") == UdpUrl("udpin", "127.0.0.1", 14601)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "unix://run/x",
        "unix:///",
        "unix:///a/",
        f"unix:///{'a' * 107}",
        "tcpin://[::1]:1",
        "udpout://[::1]:1",
    ],
)
def test_where_no_detections_arrive(text: str):
    with pytest.raises(UrlError):
        parse_detections_url(text)


def test_where_cursor_on_target_goes():
    assert parse_cot_url("udpout://239.2.3.1:6969") == UdpUrl("udpout", "239.2.3.1", 6969)
    assert parse_cot_url("tcpout://tak.example:8087") == TcpUrl("tcpout", "tak.example", 8087)
    for text in ("udpin://127.0.0.1:6969", "serial:///dev/ttyS0:9600", "239.2.3.1:6969"):
        with pytest.raises(UrlError):
            parse_cot_url(text)


def outcome_of(text: str) -> object:
    try:
        return parse_link_url(text)
    except UrlError as error:
        return error


pieces = st.sampled_from(
    ["serial", "udpin", "tcpout", "://", ":", "/", ",", "[", "]", "::1", "127.0.0.1", "1", "é", "\0"]
)


@settings(max_examples=300, derandomize=True)
@given(st.lists(pieces, max_size=8).map("".join) | st.text(max_size=20))
def test_any_text_is_a_url_that_prints_and_parses_back_or_an_error(text: str):
    outcome = outcome_of(text)
    assert isinstance(outcome, UrlError) or parse_link_url(str(outcome)) == outcome


def test_parsing_needs_no_socket():
    code = "import sys, fwav_companion.links.url; print({'socket', 'asyncio', 'serial'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "set()\n", done.stderr
