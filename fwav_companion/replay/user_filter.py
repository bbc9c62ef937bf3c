"""SHELL: loads a user's filter class, configured as ``module:Class``, for replays."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

from fwav_companion.config import Config
from fwav_companion.errors import ConfigError
from fwav_companion.tracking.filters.base import Filter


def load_own_filter(config: Config) -> Filter | None:
    """An instance of the configured class; None for a built-in filter. ConfigError if it cannot be loaded."""
    if not config.tracking.is_own_filter:
        return None
    where = f'{config.file}: [tracking] filter = "{config.tracking.filter}"'
    module_name, _, class_name = config.tracking.filter.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        made = getattr(import_module(module_name), class_name)(config.priors)
    except Exception as error:  # the user's module may raise anything
        message = " ".join(str(error).split())
        raise ConfigError(
            f"{where}: {type(error).__name__}: {message}; accepted: module:Class, made with the configuration's priors"
        ) from error
    if not callable(getattr(made, "initiate", None)):
        raise ConfigError(f"{where}: it has no method initiate(fix); accepted: a class like tracking.base.Filter")
    own: Filter = made
    return own
