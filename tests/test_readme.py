"""The README: what it is in the first sentence, two command lines, and only files and commands that exist."""

import re
import shlex
from pathlib import Path

import pytest

from fwav_companion.__main__ import main

FOLDER = Path(__file__).parents[1]
README = (FOLDER / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```\n(.*?)```", README, re.DOTALL)


def test_the_first_sentence_says_what_it_is_for_and_where_it_runs():
    first = README.split("\n\n")[1].replace("\n", " ").partition(". ")[0]
    for words in ("drone", "companion computer", "Raspberry Pi", "latitude and longitude"):
        assert words in first


def test_the_first_screen_has_the_demonstration_the_tests_and_a_picture():
    first_screen = README[: README.index("## What it does")]
    assert len(first_screen.splitlines()) < 25
    demo, tests = BLOCKS[:2]
    assert demo in first_screen
    assert tests in first_screen
    for line, job in ((demo, "fwav-companion demo"), (tests, "python -m pytest")):
        assert line.startswith("python3 -m venv .venv && ")  # a fresh machine
        assert job in line
        assert line.count("\n") == 1
    assert "![" in first_screen


def test_every_file_that_it_names_is_there():
    named = re.findall(r"\]\(([^)]+)\)", README)
    assert len(named) >= 5
    for name in named:
        assert (FOLDER / name).exists(), name


def test_every_command_that_it_shows_exists(capsys):
    shown = {
        shlex.split(line, comments=True)[1]
        for block in BLOCKS
        for line in block.splitlines()
        if line.startswith("fwav-companion ")
    }
    assert len(shown) >= 7
    for command in shown:
        with pytest.raises(SystemExit) as ended:
            main([command, "--help"])
        assert ended.value.code == 0, command
        capsys.readouterr()
