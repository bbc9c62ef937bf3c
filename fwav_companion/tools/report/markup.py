"""Pieces of the page: figures, keys, tables, sections. What comes from a recording is escaped here. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

KeyEntry = tuple[str, str, str]
"""(colour, form, name); forms: line | dot | area | cross."""


def figure(title: str, drawn: str, caption: str = "", *, key: str = "", below: str = "") -> str:
    """A drawing with its title, its key, and what it says."""
    told = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f"<figure><h3>{escape(title)}</h3>{key}{drawn}{told}{below}</figure>"


def key(entries: Iterable[KeyEntry]) -> str:
    """What the colours mean."""
    told = "".join(f'<li><i class="k-{form} k-{kind}"></i>{escape(name)}</li>' for kind, form, name in entries)
    return f'<ul class="key">{told}</ul>'


def table(head: Sequence[str], rows: Iterable[str]) -> str:
    """``rows`` are markup."""
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f'<div class="scroll"><table><tr>{names}</tr>{"".join(rows)}</table></div>'


def row(cells: Sequence[str], kind: str = "", at: int = -1) -> str:
    """Text of a row; ``kind`` colours the cell at this place."""
    told = [f"<td>{escape(cell)}</td>" for cell in cells]
    if kind:
        told[at] = told[at].replace("<td>", f'<td class="{kind}">', 1)
    return f"<tr>{''.join(told)}</tr>"


def section(title: str, words: str, inside: str) -> str:
    """A heading, a paragraph, and what follows."""
    paragraph = f"<p>{escape(words)}</p>" if words else ""
    return f"<section><h2>{escape(title)}</h2>{paragraph}{inside}</section>"
