"""Files named by users: an invalid one is refused before any waiting, and an output is complete or absent."""

import os
import socket
import stat

import pytest

from fwav_companion import on_disk
from fwav_companion.on_disk import content, created, made_folder, open_regular, whole


def test_a_file_is_read_through_links_and_the_null_device_is_an_empty_one(tmp_path):
    (tmp_path / "file").write_bytes(b"\x00\xff")
    (tmp_path / "link").symlink_to("file")
    assert content(tmp_path / "link") == b"\x00\xff"
    (tmp_path / "null").symlink_to(os.devnull)
    assert content(tmp_path / "null") == b""


def pipe(path):
    os.mkfifo(path)


def endless(path):
    path.symlink_to("/dev/zero")


def listening(path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(str(path))


NO_FILES = {
    "Is a pipe, not a regular file": pipe,
    "Is a device, not a regular file": endless,
    "Is a socket, not a regular file": listening,
    "Is a directory": lambda path: path.mkdir(),
    "Too many levels of symbolic links": lambda path: path.symlink_to(path.name),
    "No such file or directory": lambda path: None,
}


@pytest.mark.timeout(10)
@pytest.mark.parametrize("said", NO_FILES)
def test_what_is_no_file_is_not_waited_for(tmp_path, monkeypatch, said):
    monkeypatch.chdir(tmp_path)  # a socket's path may be no longer than 107 bytes
    path = on_disk.Path("named")
    NO_FILES[said](path)
    with pytest.raises(OSError, match="named") as caught:
        open_regular(path)
    assert caught.value.strerror == said


class Huge:
    """A file larger than the memory."""

    def __init__(self, path):
        self._file = path.open("rb")
        self.fileno = self._file.fileno

    def __enter__(self):
        return self

    def __exit__(self, *_why):
        self._file.close()

    def read(self):
        raise MemoryError


def test_a_file_larger_than_the_memory_is_said_to_be(tmp_path, monkeypatch):
    (tmp_path / "huge").write_bytes(b"12345")
    monkeypatch.setattr(on_disk, "open_regular", Huge)
    with pytest.raises(OSError, match="huge") as caught:
        content(tmp_path / "huge")
    assert caught.value.strerror == "Its 5 bytes do not fit into the memory"


@pytest.mark.parametrize("synced", [False, True])
def test_a_file_gets_its_name_when_all_of_it_stands(tmp_path, synced):
    path = tmp_path / "out"
    with whole(path, synced=synced) as file:
        file.write(b"new")
        file.flush()
        assert not path.exists()
    assert path.read_bytes() == b"new"
    assert [each.name for each in tmp_path.iterdir()] == ["out"]


def broken_off(path, why):
    with whole(path) as file:
        file.write(b"half")
        raise why


@pytest.mark.parametrize("why", [KeyboardInterrupt(), OSError(28, "No space left on device"), ZeroDivisionError()])
@pytest.mark.parametrize("before", [None, b"old"])
def test_what_is_broken_off_leaves_all_as_it_was(tmp_path, before, why):
    path = tmp_path / "out"
    if before is not None:
        path.write_bytes(before)
    with pytest.raises(type(why)):
        broken_off(path, why)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == ({} if before is None else {"out": before})


def test_a_full_disk_is_reported_by_the_name_of_the_file(tmp_path):
    full = OSError(28, "No space left on device")
    with pytest.raises(OSError, match="No space"):
        broken_off(tmp_path / "out", full)
    assert full.filename == str(tmp_path / "out")


def test_what_is_replaced_keeps_its_links_and_its_permissions(tmp_path):
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "real").chmod(0o640)
    (tmp_path / "link").symlink_to("real")
    with whole(tmp_path / "link") as file:
        file.write(b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"
    assert stat.S_IMODE((tmp_path / "real").stat().st_mode) == 0o640


@pytest.mark.parametrize("mask", [0o000, 0o022, 0o027, 0o077])
@pytest.mark.parametrize("before", [None, 0o600])
def test_permissions_that_are_given_hold_whatever_the_umask(tmp_path, mask, before):
    if before is not None:
        (tmp_path / "out").write_bytes(b"old")
        (tmp_path / "out").chmod(before)
    usual = os.umask(mask)
    try:
        with whole(tmp_path / "out", mode=0o644):
            pass
    finally:
        os.umask(usual)
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == 0o644


def prepared_link(path, other):
    path.symlink_to(other)


def prepared_file(path, other):
    path.hardlink_to(other)


@pytest.mark.parametrize("prepared", [prepared_link, prepared_file])
def test_a_temporary_file_that_another_process_prepared_is_not_written_through(tmp_path, prepared):
    """In a folder that others may write, a link in place of the temporary file would overwrite what it leads to."""
    other = tmp_path / "other"
    other.write_bytes(b"precious")
    prepared(tmp_path / f".out.{os.getpid()}", other)
    with whole(tmp_path / "out") as file:
        file.write(b"new")
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == {"other": b"precious", "out": b"new"}
    assert not (tmp_path / "out").is_symlink()


def test_a_temporary_name_that_cannot_be_cleared_is_an_error_by_the_files_name(tmp_path):
    (tmp_path / f".out.{os.getpid()}").mkdir()
    with pytest.raises(OSError, match="out") as caught, whole(tmp_path / "out"):
        pass
    assert caught.value.filename == str(tmp_path / "out")


def test_a_file_that_must_be_new_is_not_written_through_a_link(tmp_path):
    (tmp_path / "other").write_bytes(b"precious")
    (tmp_path / "link").symlink_to("other")
    (tmp_path / "dangling").symlink_to("nowhere")
    for name in ("other", "link", "dangling"):
        with pytest.raises(FileExistsError):
            created(tmp_path / name)
    assert (tmp_path / "other").read_bytes() == b"precious"
    assert not (tmp_path / "nowhere").exists()


def test_what_is_protected_stays(tmp_path, monkeypatch):
    """Renaming over a protected file would not ask for permission. (Root, who may run the tests, may do everything.)"""
    (tmp_path / "out").write_bytes(b"old")
    monkeypatch.setattr(os, "access", lambda path, _mode: path != tmp_path / "out")
    with pytest.raises(PermissionError, match="out"), whole(tmp_path / "out"):
        pass
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == {"out": b"old"}


def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    with whole(tmp_path / "pipe") as file:
        file.write(b"line")
    assert os.read(reader, 100) == b"line"
    os.close(reader)
    assert (tmp_path / "pipe").is_fifo()


@pytest.mark.parametrize("name", ["nowhere/out", "file/out", "a" * 300])
def test_a_path_that_cannot_be_written_is_reported_by_the_given_name(tmp_path, name):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OSError, match=r"out|aaa") as caught, whole(tmp_path / name):
        pass
    assert caught.value.filename == str(tmp_path / name)


def test_a_folder_is_made_unless_something_else_has_its_name(tmp_path):
    assert made_folder(tmp_path / "a" / "b").is_dir()
    assert made_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "ring").symlink_to("ring")
    for name, said in (("file", "Not a directory"), ("file/a", "Not a directory"), ("ring", "Too many levels")):
        with pytest.raises(OSError, match=said) as caught:
            made_folder(tmp_path / name)
        assert caught.value.filename == str(tmp_path / name)


def test_a_long_name_in_any_alphabet_can_be_had(tmp_path):
    path = tmp_path / ("ж" * 127)
    with whole(path) as file:
        file.write(b"new")
    assert path.read_bytes() == b"new"
