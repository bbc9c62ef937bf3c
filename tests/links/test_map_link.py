"""Cursor on Target over TLS against a TAK-like server: certificates right and wrong, and servers that misbehave."""

import asyncio
import contextlib
import datetime as dt
import os
import zipfile

import pytest
from tak_server import DAY, Authority, TakServer, p12, package, pem, refusing_server

import fwav_companion.links.tls as tls
from fwav_companion.errors import UserError
from fwav_companion.links.base import LinkState
from fwav_companion.links.map_link import make_map_link, map_url
from fwav_companion.links.map_server import MapServer

EVENT = b'<?xml version="1.0" encoding="UTF-8"?>\n<event version="2.0" uid="u"/><x></event>'
PASSWORD = "atakatak"
CLOSING_S = 0.05
"""Some turns of the loop, in which aborted transports close their sockets."""


@pytest.fixture(scope="module")
def authority():
    return Authority()


@pytest.fixture(scope="module")
def files(authority, tmp_path_factory):
    """A folder with the files of one unit."""
    folder = tmp_path_factory.mktemp("unit")
    certificate, key = authority.issue("unit")
    (folder / "ca.pem").write_bytes(pem(authority.certificate))
    (folder / "unit.pem").write_bytes(pem(certificate))
    (folder / "unit.key").write_bytes(pem(key))
    (folder / "locked.key").write_bytes(pem(key, PASSWORD))
    (folder / "unit.p12").write_bytes(p12(certificate, key, PASSWORD))
    (folder / "ca.p12").write_bytes(p12(None, None, PASSWORD, [authority.certificate]))
    (folder / "password").write_text(PASSWORD + "\n")
    return folder


def unit(files, port, **changes):
    usual = {
        "url": f"tls://127.0.0.1:{port}",
        "client_cert": str(files / "unit.pem"),
        "client_key": str(files / "unit.key"),
        "ca": str(files / "ca.pem"),
    }
    return MapServer(**usual | changes)


def run(server, until, sends=3):
    """The states (up, why) of a link, and its status, once ``until`` holds; an event is sent every 10 ms."""
    states = []

    async def session():
        link, _ = make_map_link(server, lambda _name, up, why: states.append((up, why)))
        link.start()
        sent = 0
        async with asyncio.timeout(20):
            while not until(states):
                if link.state is LinkState.UP and sent < sends:
                    link.send(EVENT)
                    sent += 1
                await asyncio.sleep(0.01)
        status = link.status()
        link.close()
        await asyncio.sleep(CLOSING_S)
        return status

    return states, asyncio.run(session())


def failed(states):
    return any(not up for up, _ in states)


FORMS = {
    "pem": {},
    "pem with a password": {"client_key": "locked.key", "password_file": "password"},
    "p12": {"client_cert": "unit.p12", "client_key": "", "ca": "ca.p12", "password_file": "password"},
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_right_certificates_deliver_whole_events(authority, files, tmp_path, form):
    given = {key: str(files / name) if name else "" for key, name in form.items()}
    with TakServer(tmp_path, authority, *authority.issue("tak.example")) as server:
        states, status = run(unit(files, server.port, **given), lambda _: len(server.events) == 3)
        assert server.events == [EVENT] * 3
        assert dict(server.clients[0]["subject"][0])["commonName"] == "unit"
    assert states == [(True, "")]
    assert (status.bytes_out, status.dropped) == (3 * len(EVENT), 0)


@pytest.mark.parametrize("layout", ["atak", "itak"])
def test_package_of_pytak_gives_address_and_certificates(authority, files, tmp_path, layout):
    with TakServer(tmp_path, authority, *authority.issue("tak.example")) as server:
        path = tmp_path / "dp.zip"
        package(path, "127.0.0.1", server.port, files / "ca.p12", files / "unit.p12", PASSWORD, layout)
        given = MapServer(package=str(path))
        assert str(map_url(given)) == f"tls://127.0.0.1:{server.port}"
        run(given, lambda _: len(server.events) == 3)


def today():
    return dt.datetime.now(dt.UTC).strftime("%Y-%m-%d")


FAULTS = {
    "expired": ({"begins": -9 * DAY, "ends": -DAY}, {}, "the server's certificate expired"),
    "not yet valid": ({"begins": DAY}, {}, "not yet valid: this board's date is TODAY; set its clock"),
    "another name": ({"addresses": ()}, {}, 'not for "127.0.0.1": set cot_server_name'),
}


@pytest.mark.parametrize(("issued", "given", "told"), FAULTS.values(), ids=FAULTS)
def test_certificate_fault_is_one_line(authority, files, tmp_path, issued, given, told):
    with TakServer(tmp_path, authority, *authority.issue("tak.example", **issued)) as server:
        states, _ = run(unit(files, server.port, **given), failed)
        assert server.events == []
    why = next(why for up, why in states if not up)
    assert told.replace("TODAY", today()) in why
    assert "\n" not in why


def test_wrong_authority_is_refused_before_anything_is_sent(authority, files, tmp_path):
    (tmp_path / "other.pem").write_bytes(pem(Authority("another").certificate))
    with TakServer(tmp_path, authority, *authority.issue("tak.example")) as server:
        states, status = run(unit(files, server.port, ca=str(tmp_path / "other.pem")), failed)
        assert server.events == []
    assert states == [(False, states[0][1])]
    assert "not signed by the authority of cot_ca" in states[0][1]
    assert status.bytes_out == 0


def test_system_authorities_do_not_replace_the_servers_own(authority, files, tmp_path):
    with TakServer(tmp_path, authority, *authority.issue("tak.example")) as server:
        states, _ = run(unit(files, server.port, ca=""), failed)
    assert "not signed by the authority" in states[0][1]


REFUSALS = {
    "no certificate": ({"client_cert": "", "client_key": ""}, "demands a client certificate: set cot_client_cert"),
    "of another authority": ({}, "does not know the authority of this unit's certificate"),
}


@pytest.mark.parametrize(("given", "told"), REFUSALS.values(), ids=REFUSALS)
def test_refusal_by_the_server_is_one_line(authority, files, tmp_path, given, told):
    issued = authority.issue("tak.example")
    server = TakServer(tmp_path, authority, *issued, client_ca=authority if given else Authority("another"))
    with refusing_server(server) as port:
        states, _ = run(unit(files, port, **given), failed, sends=0)
    assert told in next(why for up, why in states if not up)


def test_expected_name_replaces_the_host(authority, files, tmp_path):
    with TakServer(tmp_path, authority, *authority.issue("tak.example", addresses=())) as server:
        run(unit(files, server.port, server_name="tak.example"), lambda _: len(server.events) == 3)


def test_server_that_closes_after_the_handshake_is_reported_and_retried(authority, files, tmp_path):
    with TakServer(tmp_path, authority, *authority.issue("tak.example"), behaviour="closes") as server:
        states, _ = run(unit(files, server.port), lambda _: len(server.clients) > 1)
    assert (False, "closed by the peer") in states


def test_server_that_never_reads_costs_a_bounded_queue_and_is_reported(authority, files, tmp_path, monkeypatch):
    monkeypatch.setattr(tls, "STALLED_S", 0.5)
    event = b"<event>" + bytes(60_000) + b"</event>"
    queued = []

    async def session():
        states = []
        link, _ = make_map_link(unit(files, server.port), lambda _name, up, why: states.append((up, why)))
        link.start()
        async with asyncio.timeout(20):
            while not failed(states):
                for _ in range(20):
                    link.send(event)
                stream = link._connection
                if stream is not None:
                    queued.append(stream._waiting_bytes + stream.transport.get_write_buffer_size())
                await asyncio.sleep(0.01)
        dropped = link.status().dropped
        link.close()
        await asyncio.sleep(CLOSING_S)
        return states, dropped

    with TakServer(tmp_path, authority, *authority.issue("tak.example"), behaviour="never_reads") as server:
        states, dropped = asyncio.run(session())
    assert "has read nothing for 0.5 s" in states[-1][1]
    assert dropped > 100
    assert max(queued) < 1_000_000  # the queue, asyncio's buffer, and what the TLS layer holds


def test_plain_server_is_named_as_one(files):
    async def session():
        def greet(_reader, writer):
            writer.write(b"<event></event>\n" * 9)
            writer.close()

        server = await asyncio.start_server(greet, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        states = []
        link, _ = make_map_link(unit(files, port), lambda _name, up, why: states.append((up, why)))
        link.start()
        async with asyncio.timeout(20):
            while not states:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        link.close()
        server.close()
        await asyncio.sleep(CLOSING_S)
        return states

    assert "does not speak TLS" in asyncio.run(session())[0][1]


BAD_FILES = {
    "no such file": ({"ca": "none.pem"}, "cot_ca .*none.pem: No such file"),
    "not a certificate": ({"ca": "password"}, "cot_ca: not a .p12 file"),
    "a key of another certificate": ({"client_key": "other.key"}, "cot_client_key: not the key of cot_client_cert"),
    "a locked key without its password": ({"client_key": "locked.key"}, "cot_client_"),
    "a .p12 without its password": (
        {"client_cert": "unit.p12", "client_key": ""},
        "not a .p12 file with this password",
    ),
    "a key alone": ({"client_cert": ""}, "cot_client_key without cot_client_cert"),
    "an empty file": ({"ca": "empty"}, "cot_ca .*empty: empty"),
    "a password of two kilobytes": (
        {"client_key": "locked.key", "password_file": "long"},
        "cot_password_file: password cannot be longer than 1024 bytes",
    ),
}


@pytest.mark.parametrize(("names", "told"), BAD_FILES.values(), ids=BAD_FILES)
def test_bad_file_is_one_line_without_the_password(authority, files, names, told):
    (files / "other.key").write_bytes(pem(authority.key))
    (files / "empty").write_bytes(b"")
    (files / "long").write_text(PASSWORD * 256)
    given = {key: str(files / name) if name else "" for key, name in names.items()}
    with pytest.raises(UserError, match=told) as error:
        make_map_link(unit(files, 8089, **given), lambda *_: None)
    assert "\n" not in str(error.value)
    assert PASSWORD not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04" + bytes(40), os.urandom(500), b"<event/>"])
def test_damaged_package_is_one_line(tmp_path, content):
    path = tmp_path / "dp.zip"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"cot_package .*: damaged, or not a package"):
        map_url(MapServer(package=str(path)))


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_package_with_any_one_byte_damaged_is_read_or_is_one_line(tmp_path, method):
    path = tmp_path / "dp.zip"
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("unit.pref", '<a><entry key="connectString0">example.org:8089:ssl</entry></a>')
    content = path.read_bytes()
    for at in range(len(content)):
        path.write_bytes(content[:at] + bytes([content[at] ^ 0x55]) + content[at + 1 :])
        with contextlib.suppress(UserError):
            map_url(MapServer(package=str(path)))


@pytest.mark.parametrize("encoding", ["no-such", "hex", "utf-16"])
def test_package_in_an_encoding_that_is_not_known_is_one_line(tmp_path, encoding):
    path = tmp_path / "dp.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("unit.pref", f'<?xml version="1.0" encoding="{encoding}"?><a/>')
    with pytest.raises(UserError, match=r"cot_package .*: damaged, or not a package"):
        map_url(MapServer(package=str(path)))
