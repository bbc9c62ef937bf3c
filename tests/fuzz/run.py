"""Coverage-guided fuzzing of every entrance for bytes from strangers, by atheris (libFuzzer).

``python tests/fuzz/run.py [TARGET ...] --seconds 3600`` shares the time between the targets, begins with the corpus of
the repository, prints the runs of each, and ends with 1 if one failed. What failed is kept as a file in the corpus, so
that the default tests repeat it. ``--found DIR`` keeps the inputs that reached new code: the next run begins with them.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
SUPPORT = HERE.parent / "support"
LONGEST_INPUT = 4096
SLOWEST_S = 20
"""One input that takes longer is a failure."""
MOST_MB = 1500
CHILD = "--child"


def main() -> int:
    """Fuzz the named targets one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="by default all")
    parser.add_argument("--seconds", type=float, default=300.0, help="for all targets together")
    parser.add_argument("--found", metavar="DIR", help="folder for inputs that reached new code")
    parser.add_argument("--seed", type=int, default=0, help="0: drawn, and printed by the fuzzer")
    arguments = parser.parse_args()
    names = arguments.targets or sorted(path.name for path in CORPUS.iterdir())
    seconds = arguments.seconds / len(names)
    with tempfile.TemporaryDirectory() as temporary:
        found = Path(arguments.found or temporary)
        results = [_fuzz(name, seconds, arguments.seed, found / name) for name in names]
    return int(any(results))


def _fuzz(name: str, seconds: float, seed: int, found: Path) -> int:
    """Fuzz one target in a process of its own; return its exit status."""
    found.mkdir(parents=True, exist_ok=True)
    options = [f"-max_total_time={max(1, round(seconds))}", f"-max_len={LONGEST_INPUT}", f"-timeout={SLOWEST_S}"]
    options += [f"-rss_limit_mb={MOST_MB}", f"-seed={seed}", f"-artifact_prefix={CORPUS / name}/failed-"]
    options += ["-print_final_stats=1", str(found), str(CORPUS / name)]
    done = subprocess.run(_child(name, *options), capture_output=True, text=True, check=False)
    runs, covered = _last(r"stat::number_of_executed_units: (\d+)", done.stderr), _last(r"cov: (\d+)", done.stderr)
    print(f"{name}: {runs} runs, {covered} branches covered, exit status {done.returncode}", flush=True)
    if done.returncode:
        print(f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}", flush=True)
    return done.returncode


def _child(name: str, *options: str) -> list[str]:
    return [sys.executable, str(Path(__file__).absolute()), CHILD, name, *options]


def _last(pattern: str, text: str) -> str:
    return (re.findall(pattern, text) or ["?"])[-1]


def _as_child() -> None:
    import atheris

    sys.path[:0] = [str(SUPPORT)]
    with atheris.instrument_imports(include=["fwav_companion"]):
        from fuzz_targets import TARGETS
    _, _, name, *options = sys.argv
    os.environ["RUNTIME_DIRECTORY"] = tempfile.gettempdir()
    atheris.Setup([sys.argv[0], *options], TARGETS[name])
    atheris.Fuzz()


if __name__ == "__main__":
    if sys.argv[1:2] == [CHILD]:
        _as_child()
    else:
        sys.exit(main())
