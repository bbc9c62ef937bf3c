"""The handbook's reference pages follow from the code, and each name that users meet is explained."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return dict(runpy.run_path(str(DOCS / "make_reference.py"))["pages"]())


@pytest.mark.parametrize("name", ["commands.md", "configuration.md", "reasons.md", "notices.md", "findings.md"])
def test_a_page_is_what_the_code_says(name, pages):
    committed = (DOCS / "reference" / name).read_text(encoding="utf-8")
    assert committed == pages[name], "run docs/make_reference.py"


def test_every_row_has_a_meaning(pages):
    """A key, reason, notice or finding without words is a missing docstring in the code."""
    for name, text in pages.items():
        rows = [line for line in text.splitlines() if line.startswith("| `")]
        assert name == "commands.md" or rows
        for line in rows:
            cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            assert all(cells), f"{name}: {line}"


def test_every_key_that_init_shows_has_its_row(pages):
    shown = (DOCS.parent / "tests" / "outside" / "configuration_shown.txt").read_text().splitlines()[1:]
    for key in {line.rpartition(".")[2] for line in shown}:
        assert f"| `{key}` |" in pages["configuration.md"]
