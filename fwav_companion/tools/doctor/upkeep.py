"""The board, its disk, its supply, and the service's own health."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence, Folder
from fwav_companion.tools.doctor.finding import Finding, Level

VOLATILE: Final = frozenset({"tmpfs", "ramfs", "overlay", "squashfs"})
"""File systems whose new content is gone with the power; overlay is how boards mount a read-only root."""
MB: Final = 1_000_000


def upkeep(evidence: Evidence) -> Iterator[Finding]:
    """All of it."""
    yield from _key(evidence)
    for folder in evidence.board.folders:
        yield from _folder(evidence, folder)
    yield from _state(evidence)
    yield from _power(evidence)
    yield from _video(evidence)
    yield from _service(evidence)


def _key(evidence: Evidence) -> Iterator[Finding]:
    if evidence.files.key_error:
        yield Finding(
            "signing_key", Level.STOPS, "[signing] key_file", evidence.files.key_error,
            "head -c 32 /dev/urandom > signing.key; chmod 600 signing.key; the same key in the autopilot",
        )  # fmt: skip


def _folder(evidence: Evidence, folder: Folder) -> Iterator[Finding]:
    if folder.missing_mount is not None:
        yield Finding(
            "not_mounted", Level.HARMS, folder.key,
            f"{folder.path}: {folder.missing_mount}: what is written goes to the disk of the system",
            f"sudo mount {folder.missing_mount.point}, with RequiresMountsFor= in the unit, or another directory",
        )  # fmt: skip
    if folder.read_only or not folder.writable:
        why = (
            "its file system is mounted read-only" if folder.read_only else f"{evidence.board.user} may not write there"
        )
        yield Finding(
            "read_only", Level.HARMS, folder.key, f"{folder.path}: {why}",
            "sudo mount -o remount,rw, or another directory"
            if folder.read_only
            else f"sudo chown {evidence.board.user} {folder.path}, or another directory",
        )  # fmt: skip
    elif folder.file_system in VOLATILE:
        yield Finding(
            "volatile", Level.HARMS, folder.key,
            f"{folder.path} is on {folder.file_system}: with the power it is gone", "a directory on the card or a disk",
        )  # fmt: skip
    least = evidence.config.record.min_free_mb * MB
    if folder.key.startswith("[record]") and folder.free_bytes is not None and folder.free_bytes < least:
        yield Finding(
            "disk_full", Level.HARMS, folder.key,
            f"{folder.free_bytes // MB} MB are free, {least / MB:.0f} MB are to stay so: nothing will be recorded",
            "remove old recordings, or [record] remove_oldest = true",
        )  # fmt: skip


def _state(evidence: Evidence) -> Iterator[Finding]:
    wants = evidence.config.signing is not None or evidence.config.tracking.self_calibration
    if wants and not any(folder.key.startswith("[state]") for folder in evidence.board.folders):
        yield Finding(
            "no_state", Level.MINDS, "[state] directory",
            "nothing is kept between flights: neither the calibration nor the signing time",
            "[state] directory, or StateDirectory= in the unit",
        )  # fmt: skip


def _power(evidence: Evidence) -> Iterator[Finding]:
    power = evidence.board.power
    if power.low_now or power.low_since_boot:
        when = "now" if power.low_now else "since boot"
        yield Finding(
            "undervoltage", Level.HARMS, "supply",
            f"the board's supply is too low ({when}): it slows down, and may restart",
            "a stronger 5 V regulator, thicker and shorter wires",
        )  # fmt: skip
    elif power.throttled_now:
        yield Finding("throttled", Level.HARMS, "board", "the processor is slowed down", "cool it")


def _video(evidence: Evidence) -> Iterator[Finding]:
    for device in evidence.board.cameras:
        if not device.exists:
            yield Finding(
                "camera_missing", Level.STOPS, "[vision] source", f"{device.path} is not there",
                "connect the camera; v4l2-ctl --list-devices or rpicam-hello --list-cameras shows what there is",
            )  # fmt: skip
        elif not device.allowed:
            yield Finding(
                "camera_permission", Level.STOPS, "[vision] source", f"{device.path} may not be opened",
                f"sudo usermod -aG {device.group or 'video'} {evidence.board.user}, then log in again",
            )  # fmt: skip


def _service(evidence: Evidence) -> Iterator[Finding]:
    faults = int(evidence.number("internal_faults"))
    if faults:
        yield Finding(
            "internal_fault", Level.HARMS, "service", f"mistakes of the service itself: {faults}",
            "its log (journalctl -u fwav-companion) has the first one whole: please report it",
        )  # fmt: skip
    recording = evidence.ask("recording")
    if isinstance(recording, str) and recording.startswith("recording stopped"):
        yield Finding(
            "recording_stopped",
            Level.HARMS,
            "[record] directory",
            recording,
            "see to the disk, then restart the service: it records again from there on",
        )
