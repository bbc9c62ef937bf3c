"""Where Cursor on Target goes, as the configuration or the flags of `ground` say it. This is text work alone."""

from __future__ import annotations

from pathlib import Path

import msgspec


class MapServer(msgspec.Struct, frozen=True, kw_only=True):
    """Where Cursor on Target goes, with the paths of its files; "" for what is not given."""

    url: str = ""
    client_cert: str = ""
    client_key: str = ""
    password_file: str = ""
    ca: str = ""
    server_name: str = ""
    package: str = ""

    @property
    def may_use_tls(self) -> bool:
        """Whether its link may be by TLS; a package says so only once it is read."""
        return self.url.startswith("tls:") or bool(self.package)

    def resolved(self, folder: Path) -> MapServer:
        """The same with paths that count from this folder."""
        names = ("client_cert", "client_key", "password_file", "ca", "package")
        return msgspec.structs.replace(self, **{n: str(folder / v) for n in names if (v := getattr(self, n))})
