"""SHELL: the clicks of a page and the places that they give, kept in a file after each change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.tools.locate.answers import PlaceAnswers
from fwav_companion.tools.locate.clicks import MOST_CLICKS, PictureClick, require_inside
from fwav_companion.tools.locate.photographs import Photograph
from fwav_companion.tools.locate.session import LocateSession, NoAnswer
from fwav_companion.tools.locate_page.click_file import ClickFile

LONGEST_LABEL: Final = 60


class BoardState(msgspec.Struct, frozen=True, kw_only=True):
    """All that the page draws."""

    clicks: list[PictureClick]
    answers: PlaceAnswers
    without_place: list[NoAnswer]
    """Clicks that have no place on the map; the other clicks are answered without them."""


class ClickBoard:
    """The clicks by target and picture, at most one of each."""

    def __init__(
        self,
        file: ClickFile,
        photographs: Callable[[Sequence[str]], Sequence[Photograph]],
        session: Callable[[Sequence[Photograph]], LocateSession],
    ) -> None:
        """``photographs``: those to answer for, with the named ones.

        InputFileError where the file does not fit them.
        """
        self._file, self._photographs, self._session = file, photographs, session
        self._clicks: dict[tuple[str, str], PictureClick] = {(each.label, each.file): each for each in file.read()}
        self._current_session: LocateSession | None = None
        known = {each.path.name: each for each in self._shown()}
        for each in self._clicks.values():
            if each.file not in known:
                raise InputFileError(f"{file.path}: it has clicks in {each.file}, which is not among the pictures")
            require_inside(each, known[each.file].viewed_size)

    def click(self, file: str, pixel: tuple[float, float], label: str) -> None:
        """Put a target's pixel in a picture, in place of an earlier one. InputFileError where it cannot be there."""
        label = _label(label)
        if not all(isfinite(value) for value in pixel):
            raise InputFileError(f"{file}: the pixel is no number")
        photograph = {each.path.name: each for each in self._shown(file)}.get(file)
        if photograph is None:
            raise InputFileError(f"{file}: not among the pictures")
        made = PictureClick(file, pixel, label)
        require_inside(made, photograph.viewed_size)
        if len(self._clicks) >= MOST_CLICKS:
            raise InputFileError(f"{len(self._clicks)} clicks; accepted: at most {MOST_CLICKS}")
        self._keep({**self._clicks, (label, file): made})

    def remove(self, label: str, file: str | None = None) -> None:
        """Remove a target's click in a picture, or all of the target."""
        self._keep({key: each for key, each in self._clicks.items() if key[0] != label or file not in (None, key[1])})

    def rename(self, label: str, new: str) -> None:
        """Give a target another name. InputFileError where another target has it."""
        new = _label(new)
        if new != label and any(key[0] == new for key in self._clicks):
            raise InputFileError(f"{new}: another target has this name")
        changed = [
            msgspec.structs.replace(each, label=new) if each.label == label else each for each in self._clicks.values()
        ]
        self._keep({(each.label, each.file): each for each in changed})

    def state(self, *more: str) -> BoardState:
        """The places by the clicks so far; ``more``: pictures to expect targets in. InputFileError: no such picture."""
        clicks = list(self._clicks.values())
        without: list[NoAnswer] = []
        session = self._located_session(*more)
        while clicks:
            answers = session.located(clicks, expected=True)
            if not isinstance(answers, NoAnswer):
                return BoardState(clicks=list(self._clicks.values()), answers=answers, without_place=without)
            without.append(answers)
            clicks = [each for each in clicks if not _is_of(answers, each)]
        empty = PlaceAnswers(targets=[], shared=[], assumed=session.assumed)
        return BoardState(clicks=list(self._clicks.values()), answers=empty, without_place=without)

    def _located_session(self, *more: str) -> LocateSession:
        shown = self._shown(*more)
        if self._current_session is None or [each.path for each in shown] != [
            each.path for each in self._current_session.photographs
        ]:
            self._current_session = self._session(shown)
        return self._current_session

    def _shown(self, *more: str) -> Sequence[Photograph]:
        return self._photographs([*dict.fromkeys([*(each.file for each in self._clicks.values()), *more])])

    def _keep(self, clicks: dict[tuple[str, str], PictureClick]) -> None:
        """The file first: what the page shows is saved."""
        self._file.write(list(clicks.values()))
        self._clicks = clicks


def _label(text: str) -> str:
    label = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    if not 0 < len(label) <= LONGEST_LABEL:
        raise InputFileError(f"a target's name has 1 to {LONGEST_LABEL} characters")
    return label


def _is_of(refused: NoAnswer, click: PictureClick) -> bool:
    near = all(abs(a - b) < 1e-3 for a, b in zip(refused.pixel, click.pixel, strict=True))
    return click.file == refused.file and near
