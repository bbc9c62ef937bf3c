"""pyproject.toml against the code: what is imported is declared, and what is declared is imported."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement

from fwav_companion.libraries import EXTRAS, WITHOUT_WHEEL

PROJECT = Path(__file__).parents[1]
OURS = {"fwav_companion", "sitl_mock", "tests"}
DECLARED = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
NEED, OPTIONAL = DECLARED["dependencies"], DECLARED["optional-dependencies"]
RUN_BY_NAME = {"hatchling", "pytest-cov", "pytest-timeout", "pytest-xdist", "import-linter"}
"""Plugins and programs of the tests, which no test imports."""

OF_THE_SYSTEM = {"gi", "picamera2"}
"""What an operating system brings and no index: GStreamer's bindings, and a Raspberry Pi's camera."""


packages_distributions = cache(metadata.packages_distributions)
"""Distributions by the module that each brings, read once: half a second."""


def names(requirements: list[str]) -> set[str]:
    """Distributions, as PyPI normalises their names."""
    return {normalised(Requirement(each).name) for each in requirements}


def normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@cache
def statements(path: Path, *, at_start: bool) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """The imports of a file: all, or those at its top level."""
    tree = ast.parse(path.read_text())
    nodes = tree.body if at_start else ast.walk(tree)
    return tuple(node for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom)))


def imported(path: Path, *, at_start: bool = False) -> Iterator[str]:
    """Top-level names of other projects' modules. ``at_start``: only those that importing the file loads."""
    for node in statements(path, at_start=at_start):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules = [node.module or ""]
        else:
            continue
        yield from {module.partition(".")[0] for module in modules} - sys.stdlib_module_names - OURS


@cache
def used(*folders: str, at_start: bool = False) -> frozenset[str]:
    """Distributions whose modules are imported under these folders."""
    providers = packages_distributions()
    own = {path.stem for path in (PROJECT / "tests").rglob("*.py")}
    modules = {
        module
        for folder in folders
        for path in (PROJECT / folder).rglob("*.py")
        for module in imported(path, at_start=at_start)
        if module not in own
    }
    return frozenset(normalised(name) for module in modules for name in providers.get(module, [module]))


def test_the_package_declares_what_it_imports_and_imports_what_it_declares():
    extras = names([each for extra in set(EXTRAS.values()) for each in OPTIONAL[extra]])
    assert used("fwav_companion", "sitl_mock") == names(NEED) | extras
    assert not names(NEED) & extras


def test_what_an_extra_brings_is_imported_only_where_it_is_needed():
    """Study, ground, the page of `locate` and the fleet bus are loaded only after their extra was required."""
    apart = {"tools/study", "tools/locate_page", "ground", "fleet"}
    package = PROJECT / "fwav_companion"
    rooms = [path for path in (*package.iterdir(), *(package / "tools").iterdir()) if (path / "__init__.py").exists()]
    rest = [str(path.relative_to(PROJECT)) for path in rooms if str(path.relative_to(package)) not in apart | {"tools"}]
    assert used(*rest, "sitl_mock", at_start=True) <= names(NEED)


def test_the_tests_declare_what_only_they_import():
    own = names(OPTIONAL["test"]) - {"fwav-companion"} | names(OPTIONAL["mutation"])
    assert used("tests") - used("fwav_companion", "sitl_mock") - OF_THE_SYSTEM == own - RUN_BY_NAME


def test_every_extra_is_known_where_a_missing_library_is_named():
    """By import names; 'vision' is an empty extra that older install lines name."""
    providers = packages_distributions()
    for extra in set(EXTRAS.values()):
        modules = [module for module, of in EXTRAS.items() if of == extra]
        assert {normalised(each) for module in modules for each in providers[module]} == names(OPTIONAL[extra])
    assert set(OPTIONAL) == {*EXTRAS.values(), "test", "docs", "lint", "lock", "mutation", "vision"}
    assert OPTIONAL["vision"] == []


@pytest.mark.parametrize("machine", ["x86_64", "aarch64", "armv6l", "armv7l", "armv8l"])
def test_32_bit_arm_is_asked_for_nothing_that_has_no_wheel_there(machine: str):
    environment = default_environment() | {"platform_machine": machine}
    left_out = {
        each.name
        for each in map(Requirement, NEED)
        if each.marker is not None and not each.marker.evaluate(environment)
    }
    providers = packages_distributions()
    without_wheel = {name for module in WITHOUT_WHEEL for name in providers[module]}
    assert left_out == (without_wheel if machine.startswith("armv") else set())


def test_the_tests_are_not_installed():
    """An editable installation has a file that points to the checkout in place of the packages."""
    # A checkout that was installed from has an egg-info beside the packages, which is not the installation.
    installed = next(each for each in distributions(name="fwav-companion") if each.read_text("RECORD") is not None)
    tops = {path.parts[0] for path in installed.files or ()} - {"fwav_companion", "sitl_mock"}
    kinds = {Path(top).suffix or top for top in tops if not top.startswith("__editable__")}
    assert ".dist-info" in kinds
    assert kinds <= {".dist-info", ".pth", "..", "__pycache__"}


def test_no_text_names_the_project_as_if_an_index_had_it():
    """It is installed from a checkout: pip install '.[demo]'."""
    files = [*PROJECT.glob("*.md"), *(PROJECT / "systemd").iterdir(), *(PROJECT / "fwav_companion").rglob("*")]
    for path in (path for path in files if path.suffix in {".md", ".py", ".toml", ".yaml", ".service"}):
        assert not re.search(r"fwav-companion\[|install fwav-companion\b", path.read_text()), path


def test_every_library_that_a_flight_loads_has_an_upper_bound():
    for each in map(Requirement, NEED):
        assert {"<"} <= {specifier.operator for specifier in each.specifier}, each
