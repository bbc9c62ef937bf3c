"""Bytes from strangers are read or refused: the corpus and variations of it; slowly, what a fuzzer makes of it."""

import random
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from draws import slow_of
from fuzz_targets import TARGETS

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
VARIATIONS = 60
"""Of the corpus of one target."""
SOME_S, MANY_S = 10, 60
"""For each target in the slow part and by night."""


def varied(data: bytes, other: bytes, draw: random.Random) -> bytes:
    """The input with a few changes: bytes set, removed, repeated, or taken from another input."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 2, 8))):
        at = draw.randrange(len(changed) + 1)
        match draw.randrange(4):
            case 0:
                changed[at : at + 1] = bytes((draw.choice((0, 255, draw.randrange(256))),))
            case 1:
                del changed[at : at + draw.choice((1, 4, 100))]
            case 2:
                changed[at:at] = changed[at : at + draw.choice((1, 8, 200))]
            case _:
                start = draw.randrange(len(other) + 1)
                changed[at:at] = other[start : start + draw.choice((1, 8, 200))]
    return bytes(changed[:4096])


def test_every_target_has_a_corpus_and_no_other() -> None:
    assert {path.name for path in CORPUS.iterdir()} == set(TARGETS)


@pytest.mark.parametrize("name", TARGETS)
def test_the_corpus_and_variations_of_it_are_read_or_refused(name: str) -> None:
    kept = [path.read_bytes() for path in sorted((CORPUS / name).iterdir())]
    assert kept
    for data in kept:
        TARGETS[name](data)
    draw = random.Random(name)
    for _ in range(VARIATIONS):
        TARGETS[name](varied(draw.choice(kept), draw.choice(kept), draw))


@pytest.mark.timeout(300)
@pytest.mark.skipif(find_spec("atheris") is None, reason="atheris is not installed")
@pytest.mark.parametrize("seconds", slow_of(SOME_S, MANY_S, few=1))
@pytest.mark.parametrize("name", TARGETS)
def test_a_fuzzer_that_follows_coverage_finds_nothing(name: str, seconds: int) -> None:
    command = [sys.executable, str(HERE / "run.py"), name, "--seconds", str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
