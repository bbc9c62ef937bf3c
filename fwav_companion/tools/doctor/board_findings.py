"""The board, its disk and supply, its cameras, and the service's own health."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence, Folder
from fwav_companion.tools.doctor.finding import Finding, Level, access_fix
from fwav_companion.types.status import RunStatus

VOLATILE: Final = frozenset({"tmpfs", "ramfs", "overlay", "squashfs"})
"""File systems whose new content is lost with the power; overlay is how boards mount a read-only root."""
MB: Final = 1_000_000


def board_findings(evidence: Evidence) -> Iterator[Finding]:
    """Yield what the operating system and the key file show."""
    yield from _key(evidence)
    for folder in evidence.board.folders:
        yield from _folder(evidence, folder)
    yield from _state(evidence)
    yield from _power(evidence)
    yield from _cameras(evidence)


def service_findings(_evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield what the service reports of itself."""
    if status.internal_faults:
        yield Finding(
            "internal_fault",
            Level.WARNING,
            "service",
            problem=f"internal errors of the service: {status.internal_faults}",
            fix="its log (journalctl -u fwav-companion) has the first one whole: please report it",
        )
    if status.recording is not None and status.recording.startswith("recording stopped"):
        yield Finding(
            "recording_stopped",
            Level.WARNING,
            "[record] directory",
            problem=status.recording,
            fix="check the disk: ten seconds after it can be written, the recording continues in a new folder",
        )


def _key(evidence: Evidence) -> Iterator[Finding]:
    if evidence.files.key_error:
        yield Finding(
            "signing_key",
            Level.ERROR,
            "[signing] key_file",
            problem=evidence.files.key_error,
            fix="head -c 32 /dev/urandom > signing.key; chmod 600 signing.key; the same key in the autopilot",
        )


def _folder(evidence: Evidence, folder: Folder) -> Iterator[Finding]:
    """Yield what keeps a folder from being written, or its content from lasting."""
    if folder.missing_mount is not None:
        yield Finding(
            "not_mounted", Level.WARNING, folder.key,
            problem=f"{folder.path}: {folder.missing_mount}: what is written goes to the disk of the system",
            fix=f"sudo mount {folder.missing_mount.point}, with RequiresMountsFor= in the unit, or another directory",
        )  # fmt: skip
    yield from _unwritable(evidence.board.user, folder)
    least = evidence.config.record.min_free_mb * MB
    if folder.key.startswith("[record]") and folder.free_bytes is not None and folder.free_bytes < least:
        yield Finding(
            "disk_full",
            Level.WARNING,
            folder.key,
            problem=f"{folder.free_bytes // MB} MB are free, {least / MB:.0f} MB must stay free: nothing is recorded",
            fix="remove old recordings, or [record] remove_oldest = true",
        )


def _unwritable(user: str, folder: Folder) -> Iterator[Finding]:
    """Yield the first reason why nothing can be written, or why it would not last."""
    if folder.read_only:
        yield Finding(
            "read_only",
            Level.WARNING,
            folder.key,
            problem=f"{folder.path}: its file system is mounted read-only",
            fix="sudo mount -o remount,rw, or another directory",
        )
    elif folder.file_in_the_way:
        yield Finding(
            "read_only",
            Level.WARNING,
            folder.key,
            problem=f"{folder.path}: {folder.file_in_the_way} is a file",
            fix="a directory, or remove the file",
        )
    elif not folder.writable:
        yield Finding(
            "read_only",
            Level.WARNING,
            folder.key,
            problem=f"{folder.path}: {user} may not write there",
            fix=f"sudo chown {user} {folder.path}, or another directory",
        )
    elif folder.file_system in VOLATILE:
        yield Finding(
            "volatile",
            Level.WARNING,
            folder.key,
            problem=f"{folder.path} is on {folder.file_system}: its content is lost with the power",
            fix="a directory on the card or a disk",
        )


def _state(evidence: Evidence) -> Iterator[Finding]:
    wanted = evidence.config.signing is not None or evidence.config.tracking.self_calibration
    if wanted and not any(folder.key.startswith("[state]") for folder in evidence.board.folders):
        yield Finding(
            "no_state",
            Level.NOTE,
            "[state] directory",
            problem="nothing is kept between flights: neither the calibration nor the signing time",
            fix="[state] directory, or StateDirectory= in the unit",
        )


def _power(evidence: Evidence) -> Iterator[Finding]:
    power = evidence.board.power
    if power.low_now or power.low_since_boot:
        when = "now" if power.low_now else "since boot"
        yield Finding(
            "undervoltage",
            Level.WARNING,
            "supply",
            problem=f"the board's supply voltage is too low ({when}): the board slows down, and may restart",
            fix="a stronger 5 V regulator, thicker and shorter wires",
        )
    elif power.throttled_now:
        yield Finding(
            "throttled", Level.WARNING, "board", problem="the processor is slowed down by heat", fix="cool the board"
        )


def _cameras(evidence: Evidence) -> Iterator[Finding]:
    for device in evidence.board.cameras:
        if not device.exists:
            yield Finding(
                "camera_missing",
                Level.ERROR,
                "[vision] source",
                problem=f"{device.path} does not exist",
                fix="connect the camera; v4l2-ctl --list-devices or rpicam-hello --list-cameras lists what is present",
            )
        elif not device.allowed:
            yield Finding(
                "camera_permission",
                Level.ERROR,
                "[vision] source",
                problem=f"{evidence.board.user or 'this user'} may not open {device.path}",
                fix=access_fix(device.path, device.group, usual="video", user=evidence.board.user),
            )
