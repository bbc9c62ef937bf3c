"""TAK data packages: a zip file with a server's address and the certificates for it, as TAK servers hand them out."""

from __future__ import annotations

import zipfile
from pathlib import PurePosixPath
from typing import Final
from xml.etree.ElementTree import ParseError, fromstring

import msgspec

from fwav_companion.errors import UserError
from fwav_companion.links.tls_identity import MOST_BYTES, TlsFiles
from fwav_companion.links.url import TcpUrl, TlsUrl, UrlError, parse_cot_url
from fwav_companion.zip_damage import ZIP_DAMAGE

SCHEMES: Final = {"ssl": "tls", "tls": "tls", "tcp": "tcpout"}
"""Kind of a cot URL by the last part of a package's connect string."""
ACCEPTED: Final = "accepted: a TAK data package with a .pref file and its certificates"
DAMAGE: Final = (*ZIP_DAMAGE, ParseError, LookupError, ValueError)
"""What Python raises for a damaged package: that of a zip file, of XML, and of an encoding that it does not know."""


class TakServer(msgspec.Struct, frozen=True, kw_only=True):
    """The server of a package."""

    url: TlsUrl | TcpUrl
    files: TlsFiles


def read_package(path: str) -> TakServer:
    """The first enabled server of a package. UserError in one line."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _server(path, archive)
    except OSError as error:
        raise UserError(f"cot_package {path}: {error.strerror or error}") from None
    except DAMAGE:
        raise UserError(f"cot_package {path}: damaged, or not a package; {ACCEPTED}") from None


def _server(path: str, archive: zipfile.ZipFile) -> TakServer:
    preferences: dict[str, str] = {}
    prefs = [name for name in archive.namelist() if name.lower().endswith(".pref")]
    if not prefs:
        raise UserError(f"cot_package {path}: it has no .pref file; {ACCEPTED}")
    for name in prefs:
        text = _read(path, archive, name)
        if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
            raise UserError(f"cot_package {path}: {name} declares entities; {ACCEPTED}")
        for entry in fromstring(text).iter("entry"):  # noqa: S314  # without a DOCTYPE there is nothing to expand
            preferences[entry.get("key", "")] = entry.text or ""
    index = next((str(i) for i in range(_count(preferences)) if preferences.get(f"enabled{i}", "true") == "true"), "")
    connect = preferences.get(f"connectString{index}", "") if index else ""
    if not connect:
        raise UserError(f"cot_package {path}: it names no server (connectString0); {ACCEPTED}")

    def value(key: str) -> str:
        return preferences.get(f"{key}{index}") or preferences.get(key, "")

    return TakServer(
        url=_url(path, connect),
        files=TlsFiles(
            client=_file(path, archive, value("certificateLocation")),
            client_password=value("clientPassword"),
            ca=_file(path, archive, value("caLocation")),
            ca_password=value("caPassword"),
        ),
    )


def _count(preferences: dict[str, str]) -> int:
    text = preferences.get("count", "1")
    return min(int(text), 64) if text.isdecimal() else 1


def _url(path: str, connect: str) -> TlsUrl | TcpUrl:
    """The URL of HOST:PORT:KIND."""
    where, _, kind = connect.rpartition(":")
    scheme = SCHEMES.get(kind.lower())
    if scheme is None:
        raise UserError(f'cot_package {path}: connect string "{connect}"; accepted: HOST:PORT:ssl | HOST:PORT:tcp')
    try:
        url = parse_cot_url(f"{scheme}://{where}")
    except UrlError as error:
        raise UserError(f"cot_package {path}: {error}") from None
    assert isinstance(url, TlsUrl | TcpUrl)  # noqa: S101  # both schemes name one of these
    return url


def _file(path: str, archive: zipfile.ZipFile, location: str) -> bytes:
    """A certificate by its file name: packages write the folder cert, and store the file in certs or at the root."""
    if not location:
        return b""
    wanted = PurePosixPath(location).name
    for name in archive.namelist():
        if PurePosixPath(name).name == wanted:
            return _read(path, archive, name)
    raise UserError(f"cot_package {path}: it lacks {wanted}; {ACCEPTED}")


def _read(path: str, archive: zipfile.ZipFile, name: str) -> bytes:
    if archive.getinfo(name).file_size > MOST_BYTES:
        raise UserError(f"cot_package {path}: {name} is too large; {ACCEPTED}")
    with archive.open(name) as file:
        return file.read(MOST_BYTES)
