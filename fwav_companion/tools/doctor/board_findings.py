"""The board, its disk and supply, its cameras, and the service's own health."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence, Folder
from fwav_companion.tools.doctor.finding import Finding, access_case
from fwav_companion.tools.doctor.finding_table import make_finding
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
        yield make_finding("internal_fault", faults=status.internal_faults)
    if status.recording is not None and status.recording.startswith("recording stopped"):
        yield make_finding("recording_stopped", state=status.recording)


def _key(evidence: Evidence) -> Iterator[Finding]:
    if evidence.files.key_error:
        yield make_finding("signing_key", error=evidence.files.key_error)


def _folder(evidence: Evidence, folder: Folder) -> Iterator[Finding]:
    """Yield what keeps a folder from being written, or its content from lasting."""
    if folder.missing_mount is not None:
        mount = folder.missing_mount
        yield make_finding("not_mounted", key=folder.key, path=folder.path, mount=mount, point=mount.point)
    yield from _unwritable(evidence.board.user, folder)
    least = evidence.config.record.min_free_mb * MB
    if folder.key.startswith("[record]") and folder.free_bytes is not None and folder.free_bytes < least:
        yield make_finding("disk_full", key=folder.key, free_mb=folder.free_bytes // MB, least_mb=least / MB)


def _unwritable(user: str, folder: Folder) -> Iterator[Finding]:
    """Yield the first reason why nothing can be written, or why it would not last."""
    if folder.read_only:
        yield make_finding("read_only", "mount", key=folder.key, path=folder.path)
    elif folder.file_in_the_way:
        yield make_finding("read_only", "file", key=folder.key, path=folder.path, file=folder.file_in_the_way)
    elif not folder.writable:
        yield make_finding("read_only", "owner", key=folder.key, path=folder.path, user=user)
    elif folder.file_system in VOLATILE:
        yield make_finding("volatile", key=folder.key, path=folder.path, file_system=folder.file_system)


def _state(evidence: Evidence) -> Iterator[Finding]:
    wanted = evidence.config.signing is not None or evidence.config.tracking.self_calibration
    if wanted and not any(folder.key.startswith("[state]") for folder in evidence.board.folders):
        yield make_finding("no_state")


def _power(evidence: Evidence) -> Iterator[Finding]:
    power = evidence.board.power
    if power.low_now or power.low_since_boot:
        yield make_finding("undervoltage", "now" if power.low_now else "earlier")
    elif power.throttled_now:
        yield make_finding("throttled")


def _cameras(evidence: Evidence) -> Iterator[Finding]:
    for device in evidence.board.cameras:
        if not device.exists:
            yield make_finding("camera_missing", device=device.path)
        elif not device.allowed:
            yield make_finding(
                "camera_permission",
                access_case(device.group),
                device=device.path,
                group=device.group,
                user=evidence.board.user or "this user",
                member=evidence.board.user or "$USER",
            )
