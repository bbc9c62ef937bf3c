"""Every command with its options, and every exit status that needs no vehicle."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import pytest
from frozen import hold
from processes import free_port

from fwav_companion.__main__ import main

RELAY = '[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:PORT"\nrole = "autopilot"\n[detections]\nurl = ""\n'


class ParsedError(Exception):
    """Carries the argument parser of a command line."""


def parser_of(monkeypatch, words: list[str]) -> argparse.ArgumentParser:
    """The parser of the program, with the arguments of the named command."""

    def caught(self: argparse.ArgumentParser, *_: object) -> None:
        raise ParsedError(self)

    with monkeypatch.context() as patched:
        patched.setattr(argparse.ArgumentParser, "parse_known_args", caught)
        with pytest.raises(ParsedError) as parsed:
            main(words)
    parser: argparse.ArgumentParser = parsed.value.args[0]
    return parser


def commands_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    (action,) = (each for each in parser._actions if isinstance(each, argparse._SubParsersAction))
    return dict(action.choices)


def facts_of(command: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    """One line for each option: number of values, choices, whether it is required or repeated, default."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            continue
        name = " ".join(action.option_strings) or action.dest.upper()
        takes = "" if action.nargs == 0 else f" takes {action.nargs if action.nargs is not None else 1}"
        choices = f" of {', '.join(map(str, action.choices))}" if action.choices else ""
        required = " required" if action.required else ""
        repeated = " repeated" if isinstance(action, argparse._AppendAction | argparse._ExtendAction) else ""
        unset = action.default in (None, False, argparse.SUPPRESS) or required
        default = "" if unset else f" default {action.default}"
        yield f"{command} {name}{takes}{choices}{repeated}{required}{default}"


def test_every_command_and_its_options(monkeypatch):
    program = parser_of(monkeypatch, [])
    facts = set(facts_of("", program))
    for command in commands_of(program):
        facts.add(command)
        facts |= set(facts_of(command, commands_of(parser_of(monkeypatch, [command]))[command]))
    hold("commands", {fact.strip() for fact in facts})


def status_of(words: list[str]) -> int:
    try:
        return main(words)
    except SystemExit as ended:  # argparse, after --help and --version
        return 0 if ended.code is None else int(ended.code)


def test_exit_statuses(tmp_path, monkeypatch, capsys):
    """``words: status``; a status of 2 comes with one line on stderr."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wrong.toml").write_text("[tracking]\nfiltre = 1\n")
    (tmp_path / "no-link.toml").write_text('[detections]\nurl = ""\n')
    (tmp_path / "alone.toml").write_text(RELAY.replace("PORT", str(free_port())))
    (tmp_path / "empty.jsonl").write_text("")
    replay = ["replay", "--telemetry", "absent.tlog", "--detections", "empty.jsonl", "--config", "alone.toml"]
    tried = [
        [],
        ["--help"],
        ["--version"],
        ["nonsense"],
        *([command, "--help"] for command in commands_of(parser_of(monkeypatch, []))),
        *([command, "--nonsense"] for command in commands_of(parser_of(monkeypatch, []))),
        ["run", "--config", "absent.toml"],
        ["run", "--config", "wrong.toml"],
        ["run", "--config", "no-link.toml"],
        ["check", "--config", "absent.toml"],
        ["check", "--config", "wrong.toml"],
        ["check", "--config", "no-link.toml"],
        ["check", "--config", "alone.toml", "--seconds", "0"],
        ["check", "--config", "alone.toml", "--shake"],
        ["check", "--config", "alone.toml", "--seconds", "0.2"],
        [*replay, "--out", "out.jsonl"],
        [*replay, "--out", "out.jsonl", "--set", "tracking.alpha=12"],
        ["demo", "--seconds", "1"],
        ["demo", "--seed", "x"],
        ["paper", "--seed", "-1"],
        ["calibrate", "absent", "--board", "chessboard:9x6:25mm", "--out", "camera.yaml"],
        ["calibrate", "absent", "--board", "nonsense", "--out", "camera.yaml"],
        ["bench", "--only", "nonsense"],
        ["init", "made"],
        ["init", "made"],
    ]
    facts, again = [], set()
    for words in tried:
        status, name = status_of(words), " ".join(words)
        name += " (again)" if name in again else ""
        again.add(name)
        error = capsys.readouterr().err
        assert status != 2 or (error.count("\n") == 1 and error.startswith("fwav-companion: ")), (name, error)
        facts.append(f"{name}: {status}")
    hold("exits", facts)
