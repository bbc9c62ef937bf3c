"""A recording directory below a mount point: mounted, not mounted, bound to itself by systemd, or anywhere else."""

from pathlib import Path

import pytest

from fwav_companion.mount_points import MissingMount, missing_mount, missing_mount_above

ROOT = "21 1 179:2 / / rw,noatime shared:1 - ext4 /dev/root rw"
PROC = "22 21 0:5 / /proc rw - proc proc rw"
STICK = "40 21 8:1 / /media/usb rw - vfat /dev/sda1 rw"
SPACED = r"41 21 8:1 / /media/pi/MY\040DISK rw - vfat /dev/sda1 rw"
BOUND = "42 21 179:2 /media/usb /media/usb rw - ext4 /dev/root rw"
AUTOMOUNT = "43 21 0:40 / /data rw - autofs systemd-1 rw"
OTHER_DIRECTORY = "44 21 179:2 /srv/disk /media/usb rw - ext4 /dev/root rw"
SUBVOLUMES = "21 1 0:30 /@ / rw - btrfs /dev/sda2 rw\n45 21 0:30 /@data /mnt/data rw - btrfs /dev/sda2 rw"
FSTAB = """
# <file system> <mount point> <type> <options>
PARTUUID=1-02  /      ext4  defaults,noatime  0  1
/dev/sda1      /data  ext4  nofail            0  2
/dev/sdb1      /data/flights\\040of\\0402026  ext4  noauto  0  2
/swapfile      none   swap  sw                0  0
"""


@pytest.mark.parametrize(
    ("directory", "mounts", "fstab", "expected"),
    [
        ("/media/usb/flights", [], "", MissingMount("/media/usb")),
        ("/media/usb", [], "", MissingMount("/media/usb")),
        ("/media/usb/flights", [STICK], "", None),
        ("/media/other/flights", [STICK], "", MissingMount("/media/other")),
        ("/media/usb/flights", [BOUND], "", MissingMount("/media/usb")),
        ("/media/usb/flights", [OTHER_DIRECTORY], "", None),
        ("/media/pi/MY DISK/flights", [SPACED], "", None),
        ("/run/media/pi/DISK/flights", [], "", MissingMount("/run/media/pi")),
        ("/mnt/data/flights", [], "", MissingMount("/mnt/data")),
        ("/mnt", [], "", None),
        ("/var/lib/fwav-companion/recordings", [], FSTAB, None),
        ("/data/flights", [], FSTAB, MissingMount("/data", "/dev/sda1")),
        ("/data/flights", [AUTOMOUNT], FSTAB, None),
        ("/data/flights of 2026/a", [AUTOMOUNT], FSTAB, MissingMount("/data/flights of 2026", "/dev/sdb1")),
        ("/database/flights", [], FSTAB, None),
    ],
)
def test_a_mount_point_that_is_not_mounted(directory: str, mounts: list[str], fstab: str, expected: object):
    assert missing_mount(Path(directory), "\n".join([ROOT, PROC, *mounts]), fstab) == expected


def test_a_subvolume_of_the_same_disk_is_mounted():
    assert missing_mount(Path("/mnt/data/flights"), SUBVOLUMES, "") is None
    assert missing_mount(Path("/mnt/other/flights"), SUBVOLUMES, "") == MissingMount("/mnt/other")


def test_where_nothing_can_be_read_nothing_is_claimed():
    assert missing_mount(Path("/media/usb"), "", FSTAB) is None


def test_this_system(tmp_path: Path):
    """A name under /media that no system mounts, and a directory that exists."""
    assert missing_mount_above(Path("/media/fwav-companion-no-such-disk/a")) == MissingMount(
        "/media/fwav-companion-no-such-disk"
    )
    assert missing_mount_above(tmp_path) is None
