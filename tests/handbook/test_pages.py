"""The handbook's pages: links lead somewhere, commands and keys exist, the examples work."""

from __future__ import annotations

import ast
import re
import shlex
import socket
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from fwav_companion.publishing.ground_messages import NAMES
from fwav_companion.types import Frame
from fwav_companion.vision.frame_receiver import read_clocks
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
OUTSIDE = ROOT / "tests" / "outside"
HARDWARE, README, TESTED = "<!-- hardware", "<!-- as in the README -->", "<!-- tested in short: "
"""What is written above a block of commands."""


def blocks(page: Path, language: str) -> Iterator[tuple[str, str]]:
    """(the line above, the text) of every fenced block of a language."""
    for match in re.finditer(rf"([^\n]*)\n```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        yield match[1], match[2]


def names(file: str) -> set[str]:
    return set((OUTSIDE / file).read_text(encoding="utf-8").splitlines()[1:])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_link_and_picture_is_there(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if not target.startswith(("https://", "#")):
            assert (page.parent / target.partition("#")[0]).exists(), target


def test_the_navigation_has_every_page_once():
    listed = re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(listed) == sorted(str(page.relative_to(DOCS)) for page in PAGES)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_command_is_of_the_readme_or_marked_as_needing_hardware(page):
    """The README's lines are run as they are, some others by a shorter test; of all others each option must exist."""
    readme, commands = (ROOT / "README.md").read_text(encoding="utf-8"), names("commands.txt")
    assert not re.search(r"^```\n(\S*/)?fwav-companion ", page.read_text(encoding="utf-8"), re.MULTILINE), "```sh"
    for above, text in blocks(page, "sh"):
        assert above.startswith((HARDWARE, README, TESTED)), text
        for folder in above.removeprefix(TESTED).removesuffix(" -->").split(", ") if above.startswith(TESTED) else ():
            assert list((ROOT / folder).glob("test_*.py")), folder
        for line in text.replace("\\\n", " ").splitlines():
            assert above != README or line in readme
            words = shlex.split(line, comments=True)
            at = [k for k, word in enumerate(words) if word == "fwav-companion" or word.endswith("/bin/fwav-companion")]
            if not above.startswith(README) and at:
                after = words[at[0] + 1 :]
                if words[0] in {"journalctl", "systemctl"} or "systemctl" in words:
                    continue
                assert after[0] in commands, line
                for option in (word for word in after if word.startswith("--")):
                    assert any(known.split(" takes")[0] == f"{after[0]} {option}" for known in commands), line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_page_with_commands_names_their_environment(page):
    """A board has the command in its path, and its configuration in /etc."""
    if page.parent.name in {"reference", "develop"}:
        return
    bare = [
        line
        for _, text in blocks(page, "sh")
        for line in text.splitlines()
        if re.match(r"(fwav-companion|sitl-mock|python|pip) ", line) and "/etc/fwav-companion" not in line
    ]
    words = page.read_text(encoding="utf-8")
    assert not bare or "index.md#environments" in words or ". .venv/bin/activate" in words, bare
    assert not re.search(r"(?<!bin/)pip install '", words), "of which environment"


def keys_within(value, path):
    """The keys of a value that is a table or a list of tables, else its own."""
    if isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
        return {f"{path}[].{key}" for each in value for key in each}
    return {f"{path}.{key}" for key in value} if isinstance(value, dict) else {path}


def test_every_key_in_an_example_exists():
    known = {line.split(":")[0] for line in names("configuration.txt")}
    shown = 0
    for page in PAGES:
        for _, text in blocks(page, "toml"):
            for name, given in tomllib.loads(text).items():
                table, keys = (f"{name}[]", given[0]) if isinstance(given, list) else (name, given)
                for key, value in keys.items():
                    inner = keys_within(value, f"{table}.{key}")
                    assert inner <= known, f"{page.name}: {inner}"
                    shown += 1
    assert shown > 10


def test_every_finding_that_the_troubleshooting_names_exists():
    known = names("findings.txt") | {line.partition(": ")[2] for line in names("values.txt")}
    known |= {line.split(":")[0].rpartition(".")[2] for line in names("configuration.txt")}
    known |= {line.rpartition(".")[2] for line in names("status.txt")} | names("detections.txt")
    for code in re.findall(r"`([a-z]+_[a-z_]+)`", (DOCS / "troubleshooting.md").read_text(encoding="utf-8")):
        assert code in known | {"time_monotonic", "time_boot", "time_unix"}, code


def test_every_layout_of_the_detectors_page_is_one_of_the_detectors_tests():
    """Each row names its tests, and each graph with a known answer has its row."""
    text = (DOCS / "guides" / "detectors.md").read_text(encoding="utf-8")
    rows = [line.split("|") for line in text.splitlines() if line.startswith("|") and line.count("|") == 5]
    named = [name for row in rows for name in re.findall(r"`([^`]+)`", row[4])]
    table = ast.parse((ROOT / "tests" / "vision" / "model_layouts.py").read_text(encoding="utf-8"))
    tables = {
        node.targets[0].id: node.value
        for node in table.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and isinstance(node.value, ast.Dict)
    }
    graphs = [tables[name] for name in ("LAYOUTS", "ASKED", "REFUSED")]
    assert sorted(named) == sorted(key.value for each in graphs for key in each.keys if isinstance(key, ast.Constant))
    for row in rows[2:]:
        assert re.search("right|asked|refused", row[3]), row
        assert "`" in row[4], f"{row[1]}: no test"


def test_the_detector_of_the_guide_sends_what_the_service_accepts():
    """Runs the whole example; the service's own parser takes the datagram."""
    (_, example), *_ = blocks(DOCS / "guides" / "detectors.md", "python")
    wall_clock = WallClock(*read_clocks())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 0))
        port.settimeout(10.0)
        scope: dict[str, Any] = {}
        exec(example.replace("14601", str(port.getsockname()[1])), scope)
        scope["sender"].close()
        arrival_ns, unix_ns = read_clocks()
        wall_clock.observe(arrival_ns, unix_ns)
        frame = parse_frame(port.recv(65536), arrival_ns, wall_clock)
    assert isinstance(frame, Frame)
    assert [(each.u, each.v, each.label) for each in frame.detections] == [(312.4, 201.9, "person")]


def test_each_fault_of_the_page_of_faults_names_its_test():
    rows = re.findall(
        r"^\| ([^|]+) \| `([\w/]+\.py)` `(test_\w+)`[^|]* \|$",
        (DOCS / "develop" / "faults.md").read_text(),
        re.MULTILINE,
    )
    assert len(rows) > 30
    for fault, file, name in rows:
        assert f"def {name}(" in (ROOT / "tests" / file).read_text(encoding="utf-8"), fault


def test_page_of_ground_stations_explains_each_named_value_and_names_real_messages():
    page = (DOCS / "guides/ground-stations.md").read_text(encoding="utf-8")
    explained = [name for row in re.findall(r"^\| (TGT_[^|]*) \|", page, re.MULTILINE) for name in row.split(", ")]
    assert explained == list(NAMES)
    messages = re.findall(r"^\| ((?:[A-Z]{3,}_?)+)[ ,:]", page.partition("## QGroundControl")[0], re.MULTILINE)
    messages = [each for each in messages if not each.startswith("TGT")]
    assert len(messages) >= 10
    assert all(hasattr(common, f"MAVLINK_MSG_ID_{message}") for message in messages)
