"""The observed state of a board and the request, from which the steps are decided. PURE: data only."""

from __future__ import annotations

from typing import Final

import msgspec

SERVICE: Final = "fwav-companion"
HOME: Final = "/opt/fwav-companion"
ENVIRONMENT: Final = f"{HOME}/venv"
"""Symbolic link to the environment in use; the unit's ExecStart goes through it."""
PROGRAM: Final = f"{ENVIRONMENT}/bin/{SERVICE}"
COMMAND: Final = f"/usr/local/bin/{SERVICE}"
"""Symbolic link to PROGRAM: the command in every user's shell."""
CONFIGURATION_FOLDER: Final = "/etc/fwav-companion"
CONFIGURATION: Final = f"{CONFIGURATION_FOLDER}/fwav-companion.toml"
CAMERA_FILE: Final = f"{CONFIGURATION_FOLDER}/camera.yaml"
UNIT: Final = "/etc/systemd/system/fwav-companion.service"
NETWORK_DROP_IN: Final = "/etc/systemd/system/fwav-companion.service.d/network.conf"
UDEV_RULES: Final = "/etc/udev/rules.d/99-fwav-companion.rules"
USERS: Final = "/etc/sysusers.d/fwav-companion.conf"
RECORD: Final = f"{HOME}/installed.json"
"""Path of the record of the sources of the environment in use."""
STATUS: Final = "/run/fwav-companion/status.json"
BOOT_FOLDERS: Final = ("/boot/firmware", "/boot")
"""Raspberry Pi OS from Bookworm on, and before."""


class Request(msgspec.Struct, frozen=True, kw_only=True):
    """The arguments of the command."""

    extras: tuple[str, ...] = ()
    upgrade: bool = False
    uninstall: bool = False
    boot: bool = False


class Installed(msgspec.Struct, frozen=True, kw_only=True):
    """Sources of the environment in use, the content of :data:`RECORD`."""

    version: str = ""
    extras: tuple[str, ...] = ()
    system_packages: bool = False


class Package(msgspec.Struct, frozen=True, kw_only=True):
    """The program to install, with its files for a board."""

    version: str
    path: str = ""
    """Folder of the checkout; "" where an installed package is copied."""
    extras: tuple[str, ...] = ()
    """Extras that the package offers."""
    locks: dict[str, str] = {}
    """Paths of the lock files by name, as ``board.txt``; empty where there are none."""
    files: dict[str, str] = {}
    """Contents of unit, udev rules, sample configuration and camera file, by name."""


class Platform(msgspec.Struct, frozen=True, kw_only=True):
    """The interpreter's platform: a 64-bit kernel may run a 32-bit system."""

    name: str
    """Name by ``sysconfig.get_platform()``, such as ``linux-aarch64``."""
    pointer_bits: int = 64

    @property
    def is_32_bit_arm(self) -> bool:
        """Whether PyPI has no wheels of numpy and OpenCV for this system."""
        machine = self.name.rpartition("-")[2]
        return machine.startswith("arm") or (machine == "aarch64" and self.pointer_bits == 32)

    @property
    def needs_linux32(self) -> bool:
        """Whether pip would mistake this 32-bit system for a 64-bit one because of its kernel."""
        return self.is_32_bit_arm and self.name.endswith("aarch64")


class System(msgspec.Struct, frozen=True, kw_only=True):
    """State of the board before any step."""

    platform: Platform
    root: str = "/"
    """The folder that the steps write below; commands that act on the running system are left out unless it is /."""
    texts: dict[str, str] = {}
    """Contents of the files that the steps may write or judge, by path; a file that does not exist is left out."""
    environment: str = ""
    """Name of the folder in use below HOME; "" without one."""
    environment_is_folder: bool = False
    """Whether ENVIRONMENT is a folder, as made by hand, in place of a symbolic link."""
    environments: tuple[str, ...] = ()
    """Names of all environments below HOME, the one in use included."""
    command: str | None = None
    """Target of the link COMMAND, "" if it is a file; None if there is no such path."""
    installed: Installed | None = None
    model: str = ""
    """Model of a Raspberry Pi; "" for other boards."""
    has_systemd: bool = True

    @property
    def is_running_system(self) -> bool:
        """Whether the steps change the system that runs this program."""
        return self.root == "/"
