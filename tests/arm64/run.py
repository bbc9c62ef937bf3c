"""An arm64 system in a folder, run by qemu-user: installs the program and runs a part of its tests there.

``python tests/arm64/run.py --root /tmp/arm64`` needs debootstrap and qemu-user-static, and takes some ten minutes; a
root that is there already is used again. Its packages are unpacked, not configured: it has no users and no services. Of
three ways the first that works is taken, and named at the end:

1. binfmt: the kernel hands arm64 programs to qemu, in a chroot with mounts of its own. Needs root and a binfmt_misc
   entry, which the packages qemu-user-static and binfmt-support register. Leaves out what qemu-user does: the kernel,
   its clocks and its drivers are the host's.
2. ``proot -q qemu-aarch64-static``: as root of the folder without being root. Leaves out ownership, mounts and users
   as well.
3. ``qemu-aarch64-static -L ROOT`` on the interpreter alone: programs that it starts are not arm64, so the tests that
   start processes are left out as well.

The libraries are those of requirements/board.txt for aarch64, by hash, unpacked by this machine's pip: pip itself does
not run under emulation. Timing and throughput mean nothing there.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

PROJECT = Path(__file__).parents[2]
SUITE, MIRROR = "bookworm", "https://deb.debian.org/debian"
PYTHON = "3.11"
"""Of that Debian."""
PLATFORMS = ("manylinux_2_17_aarch64", "manylinux2014_aarch64", "manylinux_2_28_aarch64", "manylinux_2_35_aarch64")
TEST_LIBRARIES = ("pytest>=8", "pytest-timeout>=2.3", "pytest-xdist>=3.6", "hypothesis>=6.100", "pymap3d>=3.1")
QEMU = "qemu-aarch64-static"
SITE, HOME = "opt/fwav/site", "opt/fwav/project"
COPIED = ("fwav_companion", "sitl_mock", "tests", "systemd", "requirements", "pyproject.toml", "README.md", "docs")
TESTS = (
    *("tests/geometry", "tests/camera/test_calibration_files.py", "tests/localization/test_refusals.py"),
    *("tests/tracking/test_schmidt_kalman.py", "tests/tracking/test_position_wander.py"),
    *("tests/mavlink/test_codec.py", "tests/mavlink/test_scanner.py", "tests/mavlink/test_signing.py"),
    *("tests/mavlink/test_routing.py", "tests/links/test_udp.py", "tests/links/test_serial.py"),
    *("tests/service/test_power_cut.py", "tests/service/test_latest_file.py", "tests/vision/test_frame_queue.py"),
)
"""Arithmetic, wire formats, sockets, terminals and files; nothing that is judged by its speed."""
WIDE_TESTS = (
    *("tests/geometry", "tests/camera", "tests/localization", "tests/pairing", "tests/telemetry", "tests/tracking"),
    *("tests/mavlink", "tests/links", "tests/publishing", "tests/service"),
    "--ignore=tests/service/test_elevation_files.py",  # rasterio is not installed there
)
"""The rooms of the daemon whole: fifty minutes."""
PROCESSES = (
    "tests/camera/test_calibration_files.py::test_yaml_is_loaded_only_for_a_file",
    "tests/service/test_power_cut.py::test_kill_9_while_a_state_is_rewritten_leaves_one_whole_file",
)
"""Tests that start a process, which the third way cannot."""
IN_CHROOT = 'mount --rbind /dev "$0/dev" && mount --rbind /proc "$0/proc" && exec chroot "$0" "$@"'
"""Run in a mount namespace of its own: nothing stays mounted."""


def main() -> int:
    """Make the root, install, run the tests, and print the way and the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=Path, default=Path("/tmp/fwav-arm64"))
    parser.add_argument("--mirror", default=MIRROR)
    parser.add_argument("--index", nargs="*", default=[], help="further arguments of pip download")
    parser.add_argument("--wide", action="store_true", help="the rooms of the daemon whole, fifty minutes")
    arguments = parser.parse_args()
    root: Path = arguments.root
    if not (root / "usr/bin/python3").exists():
        _make_root(root, arguments.mirror)
    _empty_devices(root)
    way = _way(root)
    _install(root, arguments.index)
    version = _in_root(root, way, "-c", "import platform, sys; print(platform.machine(), sys.version.split()[0])")
    tests = WIDE_TESTS if arguments.wide else TESTS
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "--timeout", "1200", *tests]
    if way == "qemu -L":
        words += [f"--deselect={test}" for test in PROCESSES]
    status = _in_root(root, way, *words)
    print(f"way: {way}; exit status {status or version}")
    return status or version


def _make_root(root: Path, mirror: str) -> None:
    """Fetch and verify the packages, and unpack them all without their scripts: half an hour less of emulation."""
    packages = "--include=python3,python3-venv,ca-certificates"
    if not (root / "var/cache/apt/archives").exists():
        _run("debootstrap", "--arch=arm64", "--foreign", "--variant=minbase", packages, SUITE, str(root), mirror)
    for package in sorted((root / "var/cache/apt/archives").glob("*.deb")):
        _run("dpkg-deb", "-x", str(package), str(root))
    if not (root / "usr/bin/python3").is_symlink():
        (root / "usr/bin/python3").symlink_to(f"python{PYTHON}")


def _empty_devices(root: Path) -> None:
    """Remove the root's own device files: in each way the host's are used, and ``qemu -L`` prefers the root's."""
    shutil.rmtree(root / "dev")
    (root / "dev").mkdir()


def _way(root: Path) -> str:
    """The first of the three ways that runs a program of the root."""
    for way in ("binfmt", "proot", "qemu -L"):
        try:
            done = subprocess.run(_command(root, way, "/bin/true"), capture_output=True, check=False)
        except FileNotFoundError:
            continue
        if done.returncode == 0:
            return way
    raise RuntimeError(f"no way to run {root}/bin/true: install qemu-user-static")


def _command(root: Path, way: str, program: str, *words: str) -> list[str]:
    if way == "binfmt":
        return ["unshare", "--mount", "sh", "-c", IN_CHROOT, str(root), program, *words]
    if way == "proot":
        return ["proot", "-q", QEMU, "-0", "-r", str(root), "-b", "/proc", "-b", "/dev", program, *words]
    return [QEMU, "-L", str(root), str(root) + program, *words]


def _install(root: Path, index: Sequence[str]) -> None:
    """Unpack the libraries for aarch64 by hash, those of the tests, and the project."""
    site, home = root / SITE, root / HOME
    target = ["--target", str(site), "--python-version", PYTHON, "--only-binary=:all:", "--implementation", "cp"]
    for platform in PLATFORMS:
        target += ["--platform", platform]
    if not site.exists():
        lock = str(PROJECT / "requirements" / "board.txt")
        _run(sys.executable, "-m", "pip", "install", "-q", *target, *index, "--require-hashes", "--no-deps", "-r", lock)
        _run(sys.executable, "-m", "pip", "install", "-q", *target, *index, *TEST_LIBRARIES)
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    for name in COPIED:
        source = PROJECT / name
        if source.is_dir():
            shutil.copytree(source, home / name, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.exists():
            shutil.copy(source, home / name)


def _in_root(root: Path, way: str, *words: str) -> int:
    """Run the root's Python in the project; the exit status."""
    inside = "" if way != "qemu -L" else str(root)
    environment = {
        **{key: value for key, value in os.environ.items() if key in {"LANG", "TERM"}},
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/tmp",
        "PYTHONPATH": f"{inside}/{HOME}:{inside}/{SITE}",
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    code = f"import os, runpy, sys; os.chdir('{inside}/{HOME}'); sys.path.insert(0, os.getcwd()); "
    if words[0] == "-m":
        code += f"sys.argv = {list(words[1:])!r}; runpy.run_module({words[1]!r}, run_name='__main__')"
    else:
        code += words[1]
    done = subprocess.run(_command(root, way, "/usr/bin/python3", "-c", code), env=environment, check=False)
    return done.returncode


def _run(*words: str) -> None:
    subprocess.run(words, check=True)


if __name__ == "__main__":
    sys.exit(main())
