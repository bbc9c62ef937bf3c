"""Writes what a board installs: lock files with hashes, one a set of extras, the licences, and a bill of materials.

``python requirements/lock.py`` needs uv, cyclonedx-bom and a package index. ``tests/test_requirements.py`` finds files
that do not match ``pyproject.toml``. The locks hold for x86-64 and arm64 Linux and every Python that the package takes;
32-bit Arm has packages of its own (systemd/README.md).
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
PYPROJECT = HERE.parent / "pyproject.toml"
DEVELOPMENT = ("test", "docs", "lint", "lock", "mutation")
"""Extras that no board needs."""
OLDEST_PYTHON = "3.11"
SBOM, LICENCES = HERE / "sbom.cdx.json", HERE / "LICENCES.md"
INPUTS = "# inputs: "


def lock_files() -> dict[str, list[str]]:
    """Return the extras of every lock file, by its name."""
    project = tomllib.loads(PYPROJECT.read_text())["project"]
    extras = [name for name, needs in project["optional-dependencies"].items() if needs and name not in DEVELOPMENT]
    single = {f"board-{extra}.txt": [extra] for extra in extras}
    return {"board-all.txt": extras, "board.txt": [], **single}


def inputs(extras: list[str]) -> str:
    """Return a digest of the requirements that a lock file was made from."""
    project = tomllib.loads(PYPROJECT.read_text())["project"]
    needs = [project["requires-python"], *project["dependencies"]]
    for extra in extras:
        needs += project["optional-dependencies"][extra]
    return hashlib.sha256("\n".join(sorted(needs)).encode()).hexdigest()


def build_inputs() -> str:
    """Return a digest of the build requirements."""
    return hashlib.sha256("\n".join(_build_requirements()).encode()).hexdigest()


def main() -> int:
    """Write all files anew."""
    for name, extras in lock_files().items():
        options = [f"--extra={extra}" for extra in extras]
        if name != "board-all.txt":  # all sets have the same versions, so that they can be combined
            options += ["--constraint", "requirements/board-all.txt"]
        _compile(["pyproject.toml", *options], HERE / name, inputs(extras))
    with tempfile.NamedTemporaryFile("w", suffix=".in") as file:
        file.write("\n".join(_build_requirements()))
        file.flush()
        _compile([file.name, "--no-annotate"], HERE / "build.txt", build_inputs())
    _write_materials()
    return 0


def _build_requirements() -> list[str]:
    requires: list[str] = tomllib.loads(PYPROJECT.read_text())["build-system"]["requires"]
    return requires


def _compile(words: list[str], to: Path, digest: str) -> None:
    command = ["uv", "pip", "compile", "--quiet", "--universal", f"--python-version={OLDEST_PYTHON}", "--upgrade",
               "--generate-hashes", "--no-header", *words]  # fmt: skip
    done = subprocess.run(command, cwd=HERE.parent, capture_output=True, text=True, check=True)
    header = f"# Written by requirements/lock.py; install with pip install --require-hashes.\n{INPUTS}{digest}\n"
    to.write_text(header + done.stdout)


def _write_materials() -> None:
    """Install all extras into an environment, and list its packages and their licences."""
    with tempfile.TemporaryDirectory() as folder:
        python = Path(folder) / "venv" / "bin" / "python"
        _run("uv", "venv", "--quiet", f"--python={OLDEST_PYTHON}", str(Path(folder) / "venv"))
        _run("uv", "pip", "install", "--quiet", f"--python={python}", "--require-hashes", "-r",
             str(HERE / "board-all.txt"))  # fmt: skip
        found = Path(folder) / "sbom.json"
        _run("cyclonedx-py", "environment", "--pyproject", str(PYPROJECT), "--output-reproducible", "--spec-version",
             "1.6", "--output-file", str(found), str(python))  # fmt: skip
        sbom = json.loads(found.read_text())
    tools = sbom["metadata"]["tools"]["components"]
    for component in (*sbom["components"], *tools):
        component.pop("externalReferences", None)  # addresses change; the purl names the package
    SBOM.write_text(json.dumps(sbom, indent=1) + "\n")
    LICENCES.write_text(_licences(sbom))


def _run(*command: str) -> None:
    subprocess.run(command, check=True)


def _licences(sbom: dict[str, Any]) -> str:
    rows = [f"| {each['name']} | {each['version']} | {_licence(each)} |" for each in sbom["components"]]
    return "\n".join([_LICENCES_HEADER, *sorted(rows, key=str.lower), ""])


def _licence(component: dict[str, Any]) -> str:
    """Return the licence as an SPDX id or expression where the package has one, else as it calls it."""
    names = [each.get("expression") or _named(each.get("license", {})) for each in component.get("licenses", ())]
    return " / ".join(dict.fromkeys(name for name in names if name)) or "not stated"


def _named(licence: dict[str, str]) -> str:
    """Return the name of a licence; of a whole text its first line."""
    name = licence.get("id") or licence.get("name") or ""
    return name.rpartition(" :: ")[2].strip().splitlines()[0] if name.strip() else ""


_LICENCES_HEADER = """# Licences of what a board installs

Written by `requirements/lock.py` from the packages' own metadata, for all extras, as Python 3.11 gets them. The bill of
materials is `sbom.cdx.json` (CycloneDX).

If you pass on an image of a board: pymavlink is LGPL-3.0, and the wheels of opencv-python-headless contain FFmpeg,
which is LGPL-2.1; those of av (extra `stream`) contain FFmpeg (LGPL-3.0), x264 and x265 (GPL-2.0 or later). Pass on
these licences. All are separate packages in the environment, so that the receiver can replace them by `pip`, as the
LGPL asks. certifi is MPL-2.0: changes to its own files stay under that licence.

| package | version | licence |
|---|---|---|"""

if __name__ == "__main__":
    sys.exit(main())
