"""The file that ``init`` writes shows every key with its true default, and none that is not there."""

import re
import tomllib
from typing import Any

import msgspec
import pytest

from fwav_companion.acting.options import ActTable
from fwav_companion.cli.init import template
from fwav_companion.config import Config, LinkConfig, SigningConfig, parse
from fwav_companion.config.document import Document
from fwav_companion.config.estimation import GroundConfig
from fwav_companion.fleet.options import FleetTable
from fwav_companion.types import ElevatedTarget, Pad, PadTag
from fwav_companion.vision.task import VisionTask

TEXT = template("fwav-companion.toml")
CHANGED = {"camera.calibration": "camera.yaml"}
"""The one key that has no default of its own."""


def flattened(tree: dict[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat |= flattened(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat


def builtins_of(value: object) -> Any:
    """The value as TOML types: lists instead of tuples."""
    return msgspec.json.decode(msgspec.json.encode(value))


def defaults() -> dict[str, object]:
    flat = flattened(builtins_of(Document()))
    tables = ("link", "landmark", "signing", "target", "pad", "vision", "fleet")
    return {key: value for key, value in flat.items() if key not in tables and value is not None}


def comments_taken_off() -> str:
    """The file with its commented keys alive; prose stays commented."""
    return re.sub(r"^# (?=\[+\w+\]+|\w+ = )", "", TEXT, flags=re.MULTILINE)


def test_it_is_a_configuration_that_run_takes():
    config = parse(TEXT, "fwav-companion.toml")
    config.require_links()
    assert config.localizes
    assert [str(link.parsed_url) for link in config.link] == [
        "serial:///dev/serial0:921600",
        "udpout://127.0.0.1:14550",
    ]
    assert [link.role for link in config.link] == ["autopilot", "gcs"]
    assert config.signing is None
    assert config.vision is None


def test_every_key_is_shown_with_its_default_and_no_other():
    shown = flattened({key: value for key, value in tomllib.loads(TEXT).items() if key != "link"})
    assert shown == defaults() | CHANGED


@pytest.mark.parametrize("key", sorted(defaults()))
def test_key_by_key(key: str):
    config: object = parse(TEXT, "f.toml")
    for part in key.split("."):
        config = getattr(config, part)
    assert builtins_of(config) == (defaults() | CHANGED)[key]


def test_what_is_commented_out_is_right_too():
    text = comments_taken_off()
    config: Config = parse(text, "f.toml")
    assert config.signing == SigningConfig()
    assert config.vision == VisionTask()
    assert config.fleet == FleetTable()
    assert config.act == ActTable()
    assert config.ground == GroundConfig(alt_amsl=412.0)
    last = config.link[-1]
    assert last == LinkConfig(name=last.name, url=last.url, role=last.role, max_rate_hz={"ATTITUDE": 4.0})
    shown = tomllib.loads(text)
    assert set(shown["signing"]) == set(SigningConfig.__struct_fields__)
    assert set(shown["vision"]) == set(VisionTask.__struct_fields__)
    assert set(shown["fleet"]) == set(FleetTable.__struct_fields__)
    assert set(shown["act"]) == set(ActTable.__struct_fields__)
    assert config.target == (
        ElevatedTarget(label="person", height_m=1.7, height_sigma_m=0.17, motion="moving", size_m=0.16),
    )
    tag = PadTag(label="tag36h11:1", size_m=0.4)
    assert config.pad == (Pad(label="pad", motion="moving", tags=(tag,)),)
    assert set(shown["pad"][-1]) == set(Pad.__struct_fields__)
    assert set(shown["pad"][-1]["tags"][0]) == set(PadTag.__struct_fields__)
    assert set(shown["target"][-1]) == set(ElevatedTarget.__struct_fields__)
    assert set(shown["link"][-1]) == set(LinkConfig.__struct_fields__)


def test_the_camera_file_is_the_papers():
    lines = [line.split("#")[0].strip() for line in template("camera.yaml").splitlines()]
    assert [line for line in lines if line] == [
        "model: kannala_brandt",
        "image_size: [640, 480]",
        "k_mm: [3.55, 0.03, 0.0, 0.0, 0.0]",
        "pixels_per_mm: [188.0, 188.0]",
        "principal_point: [320.0, 240.0]",
        "max_angle_deg: 75.0",
    ]
