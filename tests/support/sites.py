"""A folder with a configuration, a daemon that uses it, and the mock as its vehicle: shared by end-to-end tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from processes import GroundStation, Process, free_port, process

from fwav_companion.cli.main import main


class Site:
    """init's configuration, its links pointed at the mock and at a ground station."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.autopilot_port, self.detections_port = free_port(), free_port()
        self.ground = GroundStation()
        assert main(["init", str(folder)]) == 0
        self.replace('"serial:///dev/serial0:921600"', f'"udpin://127.0.0.1:{self.autopilot_port}"')
        self.replace("udpout://127.0.0.1:14550", f"udpout://127.0.0.1:{self.ground.port}")
        self.replace("udpin://127.0.0.1:14601", f"udpin://127.0.0.1:{self.detections_port}")
        self.replace('\nfile = ""', f'\nfile = "{folder}/status.json"')

    def replace(self, old: str, new: str) -> None:
        path = self.folder / "fwav-companion.toml"
        text = path.read_text()
        assert text.count(old) >= 1, old
        path.write_text(text.replace(old, new, 1))

    def service(self) -> Process:
        return process("fwav_companion", "run", "--config", "fwav-companion.toml", folder=self.folder)

    def mock(self, *words: str, seconds: float = 30.0) -> Process:
        return process(
            *("sitl_mock", "--connect", f"udpout:127.0.0.1:{self.autopilot_port}"),
            *("--detections", f"127.0.0.1:{self.detections_port}", "--seconds", str(seconds), "--truth", "truth.jsonl"),
            *words,
            folder=self.folder,
        )

    def truth(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in (self.folder / "truth.jsonl").read_text().splitlines()]

    def status(self) -> dict[str, Any]:
        status: dict[str, Any] = json.loads((self.folder / "status.json").read_text())
        return status

    def close(self) -> None:
        self.ground.close()
