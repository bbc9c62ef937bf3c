"""The lock files of boards match the package's requirements, and list what they install."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

FOLDER = Path(__file__).parents[1] / "requirements"
REMEDY = "run python requirements/lock.py"


def script():
    specification = importlib.util.spec_from_file_location("lock", FOLDER / "lock.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


LOCK = script()
LOCKS = LOCK.lock_files()
BOARDS = [(machine, python) for machine in ("x86_64", "aarch64") for python in ("3.11", "3.12", "3.13", "3.14")]


def pins(name: str) -> dict[Requirement, list[str]]:
    """Every pinned requirement with its hashes."""
    found: dict[Requirement, list[str]] = {}
    for line in (FOLDER / name).read_text().splitlines():
        if re.match(r"[A-Za-z]", line):
            requirement = Requirement(line.rstrip("\\").strip())
            found[requirement] = []
        elif match := re.match(r" +--hash=(sha256:[0-9a-f]{64})", line):
            found[requirement].append(match[1])
    return found


def environment(machine: str, python: str) -> dict[str, str]:
    board = {"platform_machine": machine, "sys_platform": "linux", "python_version": python}
    return {**default_environment(), **board, "python_full_version": f"{python}.9", "extra": ""}


def versions(name: str, where: dict[str, str]) -> dict[str, str]:
    """The version of each package that the lock file installs in an environment."""
    found: dict[str, str] = {}
    for pin in pins(name):
        if pin.marker is None or pin.marker.evaluate(where):
            (specifier,) = pin.specifier
            assert canonicalize_name(pin.name) not in found
            found[canonicalize_name(pin.name)] = specifier.version
    return found


@pytest.mark.parametrize("name", [*LOCKS, "build.txt"])
def test_no_lock_file_is_stale(name):
    made_from = LOCK.build_inputs() if name == "build.txt" else LOCK.inputs(LOCKS[name])
    assert f"{LOCK.INPUTS}{made_from}\n" in (FOLDER / name).read_text(), REMEDY


def test_there_is_one_for_every_set_of_extras_and_no_other():
    assert {path.name for path in FOLDER.glob("*.txt")} == {*LOCKS, "build.txt"}, REMEDY


@pytest.mark.parametrize("name", LOCKS)
@pytest.mark.parametrize(("machine", "python"), BOARDS)
def test_every_requirement_is_pinned_on_every_board(name, machine, python):
    project = LOCK.tomllib.loads(LOCK.PYPROJECT.read_text())["project"]
    needs = [*project["dependencies"], *(each for x in LOCKS[name] for each in project["optional-dependencies"][x])]
    where = environment(machine, python)
    installed = versions(name, where)
    for need in map(Requirement, needs):
        if need.marker is None or need.marker.evaluate(where):
            assert need.specifier.contains(installed[canonicalize_name(need.name)]), need


@pytest.mark.parametrize("name", [*LOCKS, "build.txt"])
def test_every_pin_is_exact_and_has_hashes(name):
    for pin, hashes in pins(name).items():
        assert [each.operator for each in pin.specifier] == ["=="], pin
        assert hashes, pin
        assert pin.url is None


@pytest.mark.parametrize("name", LOCKS)
def test_all_sets_have_the_same_versions(name):
    for board in BOARDS:
        where = environment(*board)
        assert versions(name, where).items() <= versions("board-all.txt", where).items()


def test_every_python_of_the_package_is_covered():
    project = LOCK.tomllib.loads(LOCK.PYPROJECT.read_text())["project"]
    assert SpecifierSet(project["requires-python"]) == SpecifierSet(f">={LOCK.OLDEST_PYTHON}")


def test_licences_and_materials_list_what_is_installed():
    installed = versions("board-all.txt", environment("x86_64", LOCK.OLDEST_PYTHON))
    components = json.loads(LOCK.SBOM.read_text())["components"]
    assert {canonicalize_name(each["name"]): each["version"] for each in components} == installed, REMEDY
    rows = [line.split(" | ") for line in LOCK.LICENCES.read_text().splitlines() if line.startswith("| ")][1:]
    assert {canonicalize_name(row[0].strip("| ")): row[1] for row in rows} == installed, REMEDY
    (pymavlink,) = [row for row in rows if "pymavlink" in row[0]]
    assert "LGPL-3.0" in pymavlink[2]


def test_no_file_names_a_registry_or_a_place_on_this_machine():
    for path in FOLDER.iterdir():
        if path.suffix in (".txt", ".json", ".md"):
            assert not re.search(
                r"--(extra-)?index|files\.pythonhosted|pypi\.org|file://|/tmp/|/home/", path.read_text()
            )
