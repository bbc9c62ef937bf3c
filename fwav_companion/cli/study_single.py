"""Flies one flight of a study alone and keeps its recording, as ``study --only`` does."""

from __future__ import annotations

import json
from math import degrees
from pathlib import Path

import msgspec

from fwav_companion.config import Config
from fwav_companion.errors import InputFileError, UserError
from fwav_companion.on_disk import made_folder, whole
from fwav_companion.tools.report.wording import length
from fwav_companion.tools.study.causes import CAUSES, NOISES
from fwav_companion.tools.study.flight_draw import CONFIGURED, PAPER_FILTER, TWICE, WITHOUT, draw_flight
from fwav_companion.tools.study.mock_process import MockError, MockProcess
from fwav_companion.tools.study.study_flight import record_of
from fwav_companion.tools.study.study_plan import RadialLens, StudyPlan

CONFIG = "fwav-companion.toml"


def fly_alone(plan: StudyPlan, chosen: str, out: Path) -> int:
    """Fly the flight, keep its recording in a folder, print its record and the replay's command."""
    index, arm = _chosen(chosen)
    draw = draw_flight(plan, index, arm)
    try:
        with MockProcess() as mock:
            flown = mock.fly(draw.request)
    except MockError as error:
        raise UserError(f"study: {error}") from None
    record = record_of(draw, plan, flown)
    folder = out / f"flight-{index}{'' if arm == CONFIGURED else f'-{arm}'}"
    files = {
        "telemetry.tlog": flown.telemetry,
        "detections.jsonl": flown.detections,
        "truth.csv": flown.truth.encode(),
        "draw.json": json.dumps({"request": draw.request, "drawn": record.drawn}, indent=1).encode(),
        camera_name(draw.claim): camera_text(plan.lens).encode(),
        CONFIG: plan.config.encode(),
    }
    try:
        made_folder(folder)
        for name, data in files.items():
            with whole(folder / name) as file:
                file.write(data)
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
    print(json.dumps(msgspec.to_builtins(record)))
    print(_words(record.error_m, record.claimed95_m))
    settings = " ".join(f"--set '{each}'" for each in draw.settings)
    print(
        f"fwav-companion replay {folder} --truth {folder / 'truth.csv'} --out {folder / 'targets.jsonl'} "
        f"--report {folder} {settings}".strip()
    )
    return 0


def camera_name(config: Config) -> str:
    """Name of the camera file in the folder, as for the configuration's own copy."""
    return config.calibration_path.name


def camera_text(lens: RadialLens) -> str:
    """The lens as a camera file."""
    numbers = {
        "image_size": list(lens.image_size),
        "k_mm": list(lens.k_mm),
        "pixels_per_mm": list(lens.pixels_per_mm),
        "principal_point": list(lens.principal_point),
        "max_angle_deg": degrees(lens.max_angle),
    }
    return "model: kannala_brandt\n" + "".join(f"{name}: {value!r}\n" for name, value in numbers.items())


def _chosen(text: str) -> tuple[int, str]:
    index, _, arm = text.partition("/")
    arms = (CONFIGURED, TWICE, PAPER_FILTER, *(f"{WITHOUT}{name}" for name in (*CAUSES, *NOISES)))
    arm = arm or CONFIGURED
    if not (index.isascii() and index.isdecimal()) or arm not in arms:
        raise UserError(f"--only {text}: accepted: INDEX or INDEX/ARM, ARM of {', '.join(arms)}")
    return int(index), arm


def _words(error_m: float | None, claimed95_m: float | None) -> str:
    if error_m is None or claimed95_m is None:
        return "no answer"
    return f"{length(error_m)} off at the end, claimed {length(claimed95_m)} (95 %)"
