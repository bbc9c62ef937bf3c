"""Which lines of a recording are about one target. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from fwav_companion.recording.lines import Line

BELIEVED = ("confirmed", "coasting")


class Group(msgspec.Struct, frozen=True):
    """The target lines of what seems to be one target."""

    label: str
    """As the detector said it."""
    name: str
    """Unlike any other's: with the track's number where several share their label."""
    lines: list[Line]

    @property
    def believed(self) -> list[Line]:
        """Where it was confirmed, seen or not."""
        return [line for line in self.lines if line["state"] in BELIEVED]

    @property
    def shown(self) -> list[Line]:
        """Where it was believed; where it never was, all that there is."""
        return self.believed or [line for line in self.lines if line["state"] != "dropped"]


def groups_of(lines: Iterable[Line]) -> list[Group]:
    """A label is one target, until two tracks of it are believed in one frame: then each track is."""
    by_label: dict[str, list[Line]] = {}
    for line in lines:
        if line["type"] == "target":
            by_label.setdefault(line["label"], []).append(line)
    groups = []
    for label, own in by_label.items():
        if not _crowded(own):
            groups.append(Group(label, label, own))
            continue
        by_track: dict[int, list[Line]] = {}
        for line in own:
            by_track.setdefault(line["track"], []).append(line)
        tracks = [Group(label, f"{label or 'target'} #{track}", each) for track, each in by_track.items()]
        groups += [group for group in tracks if group.believed]
    return groups


def _crowded(lines: Sequence[Line]) -> bool:
    """Whether two tracks were believed at the same instant."""
    seen: dict[float, int] = {}
    believed = (line for line in lines if line["state"] in BELIEVED)
    return any(seen.setdefault(line["time_unix"], line["track"]) != line["track"] for line in believed)
