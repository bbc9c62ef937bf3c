"""The log at the start names the place of recordings when their disk is not mounted."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from fwav_companion.config import parse
from fwav_companion.mount_points import MissingMount
from fwav_companion.service import service_factory as parts
from fwav_companion.service.service_factory import make_recorder


class NoLog:
    def header(self) -> None:
        """Never asked."""

    def summary(self) -> None:
        """Never asked."""


@pytest.mark.parametrize("missing", [None, MissingMount("/media/usb", "/dev/sda1")])
def test_a_disk_that_is_not_mounted_is_named_once(missing, tmp_path: Path, monkeypatch):
    asked, said = [], []
    monkeypatch.setattr(parts, "missing_mount_above", lambda path: asked.append(path) or missing)
    config = parse('[detections]\nurl = ""\n[record]\ndirectory = "usb/flights"\n', str(tmp_path / "f.toml"))
    make_recorder(config, {}, SimpleNamespace(target_log=NoLog()), said.append)
    assert asked == [tmp_path / "usb" / "flights"]
    expected = (
        "[record] directory = usb/flights: nothing is mounted at /media/usb (/dev/sda1 in /etc/fstab): recordings go "
        "to the disk of the system. Mount /media/usb, or name another directory"
    )
    assert said == ([] if missing is None else [expected])
