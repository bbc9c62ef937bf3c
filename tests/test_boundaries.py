"""The boundaries between packages, tested by their imports and by the modules that a process has loaded."""

import ast
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

import fwav_companion

PACKAGE = Path(fwav_companion.__file__).parent
PURE = (
    "camera",
    "estimation",
    "geometry",
    "localization",
    "mavlink",
    "pairing",
    "pipeline",
    "publishing",
    "replay/driver.py",
    "replay/recorded.py",
    "replay/telemetry.py",
    "self_calibration",
    "telemetry",
    "tools/install/network_access.py",
    "tools/install/plan.py",
    "tools/install/serial_port.py",
    "tools/install/steps.py",
    "tools/shake",
    "tracking",
    "types",
)
REFUSED_NAMES = {
    *("alone", "apart", "astray", "believed", "bent", "calm", "carried", "coming", "curved", "displaced", "drop_m"),
    *("fresh", "independent", "judged", "misplaced", "mixed", "opened", "passed", "placed", "refined", "released"),
    *("served", "StandingTarget", "steady", "Strange", "taught", "timed", "undone", "weighed"),
}
"""Participles and adjectives that were names: of a thing, a name is a noun; of what is done, a verb."""
ROOMS_BEING_REPLACED = ("estimation", "mavlink", "self_calibration", "telemetry", "tracking")
KEYS_ON_THE_WIRE = {"types/flight_status.py AgreementReport.apart"}
CLOCK_READERS = {"time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "now", "utcnow", "today"}


def loaded_by(statement: str) -> set[str]:
    """Top-level modules in a fresh interpreter after the statement."""
    code = f"{statement}\nimport sys\nprint(*sorted({{name.partition('.')[0] for name in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stdout.split())


def pure_files() -> list[Path]:
    rooms = [PACKAGE / room for room in PURE]
    return [path for room in rooms for path in ([room] if room.suffix else sorted(room.rglob("*.py")))]


def test_import_contracts_hold():
    project = Path(__file__).parents[1]
    lint = Path(sys.executable).parent / "lint-imports"
    done = subprocess.run([str(lint), "--no-cache"], cwd=project, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_relay_loads_only_these_libraries():
    relay = "import fwav_companion.cli.run, fwav_companion.service.daemon, fwav_companion.links.udp"
    libraries = loaded_by(relay) - loaded_by("pass") - sys.stdlib_module_names
    assert libraries - {"typing_extensions"} == {"fwav_companion", "fastcrc", "msgspec", "pymavlink"}


@pytest.mark.parametrize("calibrates", [False, True])
def test_only_self_calibration_loads_numpy(calibrates: bool):
    statement = (
        "from fwav_companion.tracking import TrackingOptions, make_tracker\n"
        "from fwav_companion.types import BIAS_COUNT, ErrorPriors\n"
        "priors = ErrorPriors(pixel_noise_px=1.0, attitude_noise=0.0, position_noise_m=0.0, height_noise_m=0.0, "
        "bias_sigmas=(0.1,) * BIAS_COUNT, position_bias_time_s=60.0)\n"
        f"make_tracker(TrackingOptions(self_calibration={calibrates}), priors)"
    )
    assert ("numpy" in loaded_by(statement)) is calibrates


def test_the_daemon_loads_no_tool():
    statement = "import fwav_companion.cli.run, fwav_companion.service.daemon"
    code = f"{statement}\nimport sys\nprint(*(name for name in sys.modules if name.startswith('fwav_companion.tools')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert not done.stdout.split()


def test_the_mock_and_the_package_do_not_know_each_other():
    assert "fwav_companion" not in loaded_by("import sitl_mock, sitl_mock.__main__")


@pytest.mark.parametrize("path", pure_files(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_pure_code_opens_nothing_and_never_asks_for_the_time(path: Path):
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        assert name not in {"open", "read_text", "read_bytes", "print", "input"}, f"{path}:{node.lineno} {name}"
        receiver = getattr(getattr(node.func, "value", None), "id", "")
        assert not (name in CLOCK_READERS and receiver in {"time", "datetime", "date"}), f"{path}:{node.lineno}"


def test_a_class_name_stands_once_in_the_package():
    where = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                where[node.name].append(str(path.relative_to(PACKAGE)))
    assert {name: files for name, files in where.items() if len(files) > 1} == {}


def definitions(path: Path) -> Iterator[tuple[str, str]]:
    """(where, name) of each class, function, constant and field of a file; parameters and local names are none."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for owner in [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]:
        for node in owner.body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                found = [node.name]
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                found = [target.id for target in targets if isinstance(target, ast.Name)]
            else:
                continue
            for name in found:
                yield f"{path.relative_to(PACKAGE)} {getattr(owner, 'name', '')}.{name}", name
            if isinstance(node, ast.FunctionDef) and node.name == "__init__":
                stored = (each for each in ast.walk(node) if isinstance(each, ast.Attribute))
                for each in stored:
                    if isinstance(each.ctx, ast.Store) and getattr(each.value, "id", "") == "self":
                        yield f"{path.relative_to(PACKAGE)} {getattr(owner, 'name', '')}.{each.attr}", each.attr


def test_no_definition_has_a_participle_or_adjective_of_the_list_for_a_name():
    files = [path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] not in ROOMS_BEING_REPLACED]
    refused = {where for path in files for where, name in definitions(path) if name.lstrip("_") in REFUSED_NAMES}
    assert refused == KEYS_ON_THE_WIRE
