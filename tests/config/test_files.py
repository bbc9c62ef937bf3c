"""The files themselves: missing, unreadable, and the signing key with its mode."""

from pathlib import Path

import pytest

from fwav_companion.config import load, load_signing_key, parse
from fwav_companion.errors import ConfigError

UTF_16 = "[ground]\n".encode("utf-16")
RELAY = '[detections]\nurl = ""\n'


def test_a_file_is_read(tmp_path: Path):
    path = tmp_path / "f.toml"
    path.write_text(RELAY)
    assert load(path).file == str(path)
    assert load(path, ["rates.attitude=7"]).rates.attitude == 7.0


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (None, "No such file or directory; accepted: a configuration, as `init` writes one"),
        (b"[ground]\n# \xff\n", "line 2 is not UTF-8; accepted: a configuration in TOML, UTF-8"),
        (UTF_16, "line 1 is not UTF-8 (UTF-16, as some editors save); accepted: a configuration in TOML, UTF-8"),
        (b"#" * 2_000_000, "longer than 1048576 bytes; accepted: a configuration in TOML"),
    ],
)
def test_a_file_that_is_none(tmp_path: Path, data: bytes | None, expected: str):
    path = tmp_path / "f.toml"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert str(caught.value) == f"{path}: {expected}"


def test_an_editors_byte_order_mark_and_line_ends_are_no_part_of_it(tmp_path: Path):
    path = tmp_path / "f.toml"
    path.write_bytes(b"\xef\xbb\xbf" + RELAY.replace("\n", "\r\n").encode())
    assert load(path).detections.url == ""


def test_a_folder_is_no_file(tmp_path: Path):
    with pytest.raises(ConfigError, match="Is a directory"):
        load(tmp_path)


def key_of(folder: Path) -> bytes | None:
    return load_signing_key(parse(f"{RELAY}[signing]\n", str(folder / "f.toml")))


def test_no_signing_no_key():
    assert load_signing_key(parse(RELAY, "f.toml")) is None


def test_a_key_of_32_bytes_for_its_owner_alone(tmp_path: Path):
    path = tmp_path / "signing.key"
    path.write_bytes(bytes(range(32)))
    path.chmod(0o600)
    assert key_of(tmp_path) == bytes(range(32))


@pytest.mark.parametrize(
    ("data", "mode", "expected"),
    [
        (None, 0o600, "No such file or directory; accepted: a file of 32 bytes, mode 0600"),
        (b"x" * 31, 0o600, "31 bytes; accepted: 32 bytes"),
        (b"x" * 33, 0o600, "more than 32 bytes; accepted: 32 bytes"),
        (b"x" * 32, 0o640, "mode 0640, readable by other users; accepted: mode 0600"),
        (b"x" * 32, 0o604, "mode 0604, readable by other users; accepted: mode 0600"),
    ],
)
def test_a_key_that_is_none(tmp_path: Path, data: bytes | None, mode: int, expected: str):
    path = tmp_path / "signing.key"
    if data is not None:
        path.write_bytes(data)
        path.chmod(mode)
    with pytest.raises(ConfigError) as caught:
        key_of(tmp_path)
    assert str(caught.value).startswith(f"{tmp_path}/f.toml: [signing] key_file = {path}: {expected}")
