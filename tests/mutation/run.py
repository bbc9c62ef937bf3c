"""Mutation test of a drawn sample: the share of small changes of the code that the tests of its room notice.

``python tests/mutation/run.py --count 300 --seed 1`` needs cosmic-ray and pytest-cov; ``--jobs`` processes share the
sample. A place in the code is drawn, then one of the changes there: another arithmetic or comparison operator, another
number, a condition reversed, a loop left out. Each change is made in a copy of the project. There the room's default
tests that reach the line run, the fastest first, until one fails or those of ``--seconds`` in all have passed. At the
end the script prints the kill rate with its lower 95 % bound (Clopper and Pearson 1934) and the survivors. A change of
nothing observable (an equal branch, a tolerance) survives too, and so does one that only slower tests or those of other
rooms notice: the rate is a lower bound.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate
from operator import itemgetter
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "fwav_companion"
COPIED = ("fwav_companion", "sitl_mock", "tests", "systemd", "pyproject.toml", "README.md")
ROOMS = {
    "localization": (("localization",), ("localization",)),
    "pairing": (("pairing",), ("pairing",)),
    "routing": (("mavlink/router",), ("mavlink",)),
    "signing": (
        ("mavlink/wire/signing.py", "mavlink/wire/strip_signature.py", "service/signing_store.py"),
        ("mavlink/test_signing.py", "mavlink/test_signed_routes.py", "mavlink/test_strip_signature.py", "service"),
    ),
    "tracking": (("tracking",), ("tracking",)),
}
"""Files of a room in the package, and its tests."""
NOTICED_S = 120
"""A change that makes the tests run longer is noticed."""
LIBRARIES = (
    *("numpy", "scipy.stats", "scipy.linalg", "scipy.spatial.transform", "scipy.interpolate", "scipy.optimize"),
    *("msgspec", "pymavlink.dialects.v20.ardupilotmega", "fastcrc", "hypothesis.strategies", "pytest"),
)
"""Loaded once: every run of tests begins as a copy of that process."""
ARITHMETIC = ("Add", "Sub", "Mul", "Div")
OPERATORS = (
    *(f"core/ReplaceBinaryOperator_{a}_{b}" for a in ARITHMETIC for b in ARITHMETIC if a != b),
    *("core/NumberReplacer", "core/AddNot", "core/ReplaceAndWithOr", "core/ReplaceOrWithAnd"),
    *("core/ReplaceTrueWithFalse", "core/ReplaceFalseWithTrue", "core/ZeroIterationForLoop"),
    *("core/ReplaceBreakWithContinue", "core/ReplaceContinueWithBreak"),
    *("core/ReplaceUnaryOperator_Delete_Not", "core/ReplaceUnaryOperator_USub_UAdd"),
)
COMPARISONS = "core/ReplaceComparisonOperator_"


class Place(NamedTuple):
    """A place in a file, and the changes that can be made there."""

    room: str
    file: Path
    line: int
    column: int
    changes: tuple[tuple[str, int], ...]
    """Name of an operator, and the how manieth of its places in the file this is."""


class Mutant(NamedTuple):
    """One change."""

    place: Place
    operator: str
    occurrence: int

    def __str__(self) -> str:
        where = f"{self.place.file.relative_to(ROOT)}:{self.place.line}:{self.place.column}"
        return f"{where} {self.operator.removeprefix('core/')}"


def main() -> int:
    """Draw the sample, run it, and print the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6))
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--seconds",
        type=float,
        default=60.0,
        help="longest time of the tests of one change, as measured with coverage: double it on a busy machine",
    )
    arguments = parser.parse_args()
    draw = random.Random(arguments.seed)
    sample = list(_drawn(arguments.rooms, arguments.count, draw))
    print(f"seed {arguments.seed}, {len(sample)} mutants of {', '.join(arguments.rooms)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        survivors, ran = _run_all(sample, Path(folder), arguments.jobs, arguments.seconds)
    killed = ran - len(survivors)
    for mutant in survivors:
        print(f"survived: {mutant}")
    print(f"killed {killed} of {ran}: {killed / ran:.1%}, at least {_lower_bound(killed, ran):.1%} (95 %)")
    return 0


def _drawn(rooms: Sequence[str], count: int, draw: random.Random) -> Iterator[Mutant]:
    """Draw different places over all rooms, then a change at each."""
    places = [place for room in rooms for path in _files(room) for place in _places(room, path)]
    for place in draw.sample(places, min(count, len(places))):
        yield Mutant(place, *draw.choice(place.changes))


def _files(room: str) -> list[Path]:
    found = [PACKAGE / name for name in ROOMS[room][0]]
    return sorted(path for each in found for path in (each.rglob("*.py") if each.is_dir() else [each]))


def _places(room: str, path: Path) -> Iterator[Place]:
    from cosmic_ray.ast import Visitor, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    names = [*OPERATORS, *(name for name in operator_names() if name.startswith(COMPARISONS))]
    operators = {name: get_operator(name)() for name in names}
    text = path.read_text()
    left_out = _not_run(text)
    changes: dict[tuple[int, int], list[tuple[str, int]]] = {}
    counts = dict.fromkeys(operators, 0)

    class Collector(Visitor):
        def visit(self, node: object) -> object:
            for name, operator in operators.items():
                for (line, column), _ in operator.mutation_positions(node):
                    if not any(start <= (line, column) < end for start, end in left_out):
                        changes.setdefault((line, column), []).append((name, counts[name]))
                    counts[name] += 1
            return node

    Collector().walk(get_ast(text))
    for (line, column), found in sorted(changes.items()):
        yield Place(room, path, line, column, tuple(found))


def _not_run(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return the ranges of what no test can notice.

    These are annotations, which are text at run time; the options of classes, as ``gc=False``; the star before keyword
    parameters; and ``strict`` of ``zip``, which holds what is true of every call.
    """
    found: list[tuple[tuple[int, int], tuple[int, int]]] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.AnnAssign) or (isinstance(node, ast.arg) and node.annotation is not None):
            found.append(_range(node.annotation))
        elif isinstance(node, ast.ClassDef) or (isinstance(node, ast.Call) and ast.unparse(node.func) == "zip"):
            found += [_range(keyword) for keyword in node.keywords]
        elif isinstance(node, ast.FunctionDef):
            found += [] if node.returns is None else [_range(node.returns)]
            before = (node.args.posonlyargs + node.args.args)[-1:]
            if node.args.kwonlyargs:
                first = node.args.kwonlyargs[0]
                begin = _range(before[0])[1] if before else (node.lineno, node.col_offset)
                found.append((begin, (first.lineno, first.col_offset)))
    return found


def _range(node: ast.AST) -> tuple[tuple[int, int], tuple[int, int]]:
    return (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)


def _run_all(sample: Sequence[Mutant], folder: Path, jobs: int, seconds: float) -> tuple[list[Mutant], int]:
    servers = [TestServer(_copied(folder / str(number))) for number in range(jobs)]
    idle: SimpleQueue[TestServer] = SimpleQueue()
    for server in servers:
        idle.put(server)

    def measured(room: str) -> Tests:
        server = idle.get()
        try:
            return _tests_by_line(room, server.copy)
        finally:
            idle.put(server)

    survivors, ran = list[Mutant](), 0

    def run(mutant: Mutant) -> bool:
        server = idle.get()
        try:
            return _survives(mutant, server, tests[mutant.place.room].of(mutant.place, seconds))
        finally:
            idle.put(server)

    with ThreadPoolExecutor(jobs) as pool:
        rooms = sorted({mutant.place.room for mutant in sample})
        tests = dict(zip(rooms, pool.map(measured, rooms), strict=True))
        for mutant, survived in zip(sample, pool.map(run, sample), strict=True):
            ran += 1
            survivors += [mutant] if survived else []
            print(f"{ran} {'SURVIVED' if survived else 'killed'} {mutant}", flush=True)
    for server in servers:
        server.close()
    return survivors, ran


def _copied(folder: Path) -> Path:
    folder.mkdir()
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    return folder


def _survives(mutant: Mutant, server: TestServer, tests: Sequence[str]) -> bool:
    """Make the change in the server's copy, run the tests, and undo it."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    path = server.copy / mutant.place.file.relative_to(ROOT)
    before = path.read_text()
    after = mutate_code(before, get_operator(mutant.operator)(), mutant.occurrence)
    if after is None:
        raise RuntimeError(f"{mutant}: not found")
    path.write_text(after)
    for compiled in (server.copy / "bytecode").rglob(f"{path.stem}.*.pyc"):  # told apart by second and size alone
        compiled.unlink()
    try:
        return server.passes(tests)
    finally:
        path.write_text(before)


class Tests(NamedTuple):
    """The default tests of a room."""

    durations: dict[str, float]
    """Seconds by their ids, the fastest first."""
    by_line: dict[tuple[str, int], set[str]]
    """Those that reach a line of a file."""

    def of(self, place: Place, seconds: float) -> list[str]:
        """Return the fastest tests for a place, of ``seconds`` together; for a line that runs at the import, any."""
        found = self.by_line.get((str(place.file.relative_to(ROOT)), place.line)) or set(self.durations)
        names = [test for test in self.durations if test in found]
        until_s = accumulate(self.durations[test] for test in names)
        return [test for test, end_s in zip(names, until_s, strict=True) if end_s <= seconds] or names[:1]


def _tests_by_line(room: str, copy: Path) -> Tests:
    """Run the tests of a room without a change, and note which lines each reaches."""
    from coverage import CoverageData

    named = [str(Path("tests") / name) for name in ROOMS[room][1]]
    words = ["--cov=fwav_companion", "--cov-context=test", "--cov-report=", "--durations=0", "--durations-min=0", "-vv"]
    done = subprocess.run(_pytest(*words, *named), cwd=copy, env=_environment(copy), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"the tests of {room} fail without a change:\n{done.stdout[-3000:]}")
    durations = {test: float(s) for s, test in re.findall(r"^([\d.]+)s call +(tests/.*)$", done.stdout, re.MULTILINE)}
    data = CoverageData(str(copy / ".coverage"))
    data.read()
    by_line: dict[tuple[str, int], set[str]] = {}
    for file in data.measured_files():
        for line, contexts in data.contexts_by_lineno(file).items():
            tests = {context.partition("|")[0] for context in contexts if context}
            by_line[str(Path(file).relative_to(copy)), line] = tests
    return Tests(dict(sorted(durations.items(), key=itemgetter(1))), by_line)


def _pytest(*words: str) -> list[str]:
    return [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *words]


def _environment(copy: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(copy), "PYTHONPYCACHEPREFIX": str(copy / "bytecode")}


class TestServer:
    """A process of one copy of the project that runs tests in copies of itself, which begin with the libraries."""

    def __init__(self, copy: Path) -> None:
        self.copy = copy
        command = [sys.executable, str(Path(__file__).with_name("fork_server.py")), *LIBRARIES]
        self._process = subprocess.Popen(
            command, cwd=copy, env=_environment(copy), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def passes(self, tests: Sequence[str]) -> bool:
        """Return whether these tests pass, within NOTICED_S."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        words = ["-q", "-x", "-p", "no:cacheprovider", *tests]
        self._process.stdin.write(json.dumps({"seconds": NOTICED_S, "words": words}) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError("the process that runs the tests has ended")
        return answer == "0\n"

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def _lower_bound(killed: int, ran: int) -> float:
    """Return the one-sided lower 95 % bound of the share (Clopper and Pearson 1934)."""
    from scipy.stats import beta

    return float(beta.ppf(0.05, killed, ran - killed + 1)) if killed else 0.0


if __name__ == "__main__":
    sys.exit(main())
