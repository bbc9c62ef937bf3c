"""The kinds of steps of an installation, each with a line that describes it. PURE: data only."""

from __future__ import annotations

import shlex
from typing import TypeAlias

import msgspec


class WriteFile(msgspec.Struct, frozen=True, kw_only=True):
    """A file to write whole, with its folder."""

    path: str
    content: str
    mode: int = 0o644
    keep: str = ""
    """Path of the copy of the old file; a copy that exists is the original, and stays."""

    def __str__(self) -> str:
        """The step in words."""
        return f"write {self.path}" + (f" (the old one is kept as {self.keep})" if self.keep else "")


class RemovePath(msgspec.Struct, frozen=True, kw_only=True):
    """A file, link or folder to remove."""

    path: str

    def __str__(self) -> str:
        """The step in words."""
        return f"remove {self.path}"


class RenamePath(msgspec.Struct, frozen=True, kw_only=True):
    """A path to rename."""

    path: str
    to: str

    def __str__(self) -> str:
        """The step in words."""
        return f"rename {self.path} to {self.to}"


class PointLink(msgspec.Struct, frozen=True, kw_only=True):
    """A symbolic link to point to another target, in one atomic step."""

    path: str
    target: str

    def __str__(self) -> str:
        """The step in words."""
        return f"point {self.path} to {self.target}"


class MakeEnvironment(msgspec.Struct, frozen=True, kw_only=True):
    """A Python environment with the program to make; a part that fails leaves none of it."""

    path: str
    source: str
    """Folder of the checkout; "" for a copy of the running package."""
    extras: tuple[str, ...] = ()
    locks: tuple[str, ...] = ()
    """Lock files whose hashes hold; empty: versions by the package's own bounds."""
    system_packages: bool = False
    linux32: bool = False

    def __str__(self) -> str:
        """The step in words."""
        extras = f"[{','.join(self.extras)}]" if self.extras else ""
        versions = "checked by the hashes of the lock files" if self.locks else "without hashes: no lock files here"
        seeing = ", seeing the system's packages" if self.system_packages else ""
        return f"make {self.path}{seeing}: fwav-companion{extras} from {self.source or 'this package'}, {versions}"


class Run(msgspec.Struct, frozen=True, kw_only=True):
    """A command to run."""

    command: tuple[str, ...]
    optional: bool = False
    """Whether a failure is reported and the installation goes on."""

    def __str__(self) -> str:
        """The step in words."""
        return "run " + shlex.join(self.command)


class AwaitHeartbeat(msgspec.Struct, frozen=True, kw_only=True):
    """Wait for the service's first heartbeat; if it does not come, do the steps ``otherwise`` and fail."""

    otherwise: tuple[PointLink | Run | WriteFile | RemovePath, ...] = ()

    def __str__(self) -> str:
        """The step in words."""
        back = "; if it does not come, go back to the old environment" if self.otherwise else ""
        return f"wait for the service's first heartbeat{back}"


class Remark(msgspec.Struct, frozen=True, kw_only=True):
    """A line for the user: no change."""

    text: str

    def __str__(self) -> str:
        """The text."""
        return f"NOTE {self.text}"


Step: TypeAlias = WriteFile | RemovePath | RenamePath | PointLink | MakeEnvironment | Run | AwaitHeartbeat | Remark
