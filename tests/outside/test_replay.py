"""The object of `replay --json` over a recorded flight of the mock with its truth."""

from __future__ import annotations

import json
import subprocess
import sys

from frozen import hold, keys

from fwav_companion.__main__ import main


def test_the_summary_with_truth(tmp_path, capsys):
    record = ["--scenario", "three_targets", "--seconds", "10", "--record", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "sitl_mock", *record], check=True, capture_output=True, timeout=60)
    assert main(["init", str(tmp_path / "site")]) == 0
    options = {
        "--telemetry": "telemetry.tlog",
        "--detections": "detections.jsonl",
        "--config": "site/fwav-companion.toml",
        "--truth": "truth.csv",
        "--out": "targets.jsonl",
    }
    words = [word for option, name in options.items() for word in (option, str(tmp_path / name))]
    assert main(["replay", *words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    hold("replay", keys([summary], "replay", tables={"replay.dropped"}))
    assert summary == json.loads((tmp_path / "targets.jsonl").read_text().splitlines()[-1])
