"""The plan of a study from its command line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

from fwav_companion.config import load
from fwav_companion.errors import UserError
from fwav_companion.on_disk import content
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.tools.study.keys import parse_setting, parse_variation
from fwav_companion.tools.study.paper_preset import paper_plan
from fwav_companion.tools.study.study_plan import StudyPlan, radial_lens

PATTERN: Final = "eight"
SECONDS: Final = 60.0
"""Duration of a flight, unless the command line gives one."""


def plan_from(arguments: argparse.Namespace) -> StudyPlan:
    """The plan. UserError, ConfigError or InputFileError for what cannot be flown."""
    settings = tuple(parse_setting(text) for group in arguments.set for text in group)
    variations = tuple(parse_variation(text) for text in arguments.vary)
    twice = [each.key for each in variations if sum(other.key == each.key for other in variations) > 1]
    if twice:
        raise UserError(f"--vary: {twice[0]} is varied twice; accepted: once")
    if arguments.preset == "paper":
        _require_nothing_of_a_flight(arguments)
        plan = paper_plan(arguments.flights, arguments.seed, settings, variations)
    else:
        plan = _configured(arguments, settings, variations)
    plan.require_possible()
    return plan


def _require_nothing_of_a_flight(arguments: argparse.Namespace) -> None:
    """Raise a UserError if the command line has an option that the preset decides."""
    chosen = {
        "--config": arguments.config is not None,
        "--pattern": arguments.pattern is not None,
        "--seconds": arguments.seconds is not None,
    }
    for option, is_chosen in chosen.items():
        if is_chosen:
            raise UserError(f"{option}: --preset paper has its own; accepted with it: --set, --vary, --flights, --seed")


def _configured(arguments: argparse.Namespace, settings: tuple, variations: tuple) -> StudyPlan:  # type: ignore[type-arg]
    if arguments.config is None:
        raise UserError("the following arguments are required: --config (see fwav-companion study --help)")
    config = load(arguments.config)
    return StudyPlan(
        config=content(Path(arguments.config)).decode().removeprefix("\ufeff"),
        config_name=arguments.config,
        lens=radial_lens(load_calibration(config).lens),
        flights=arguments.flights,
        seconds=SECONDS if arguments.seconds is None else arguments.seconds,
        pattern=PATTERN if arguments.pattern is None else arguments.pattern,
        seed=arguments.seed,
        settings=settings,
        variations=variations,
    )
