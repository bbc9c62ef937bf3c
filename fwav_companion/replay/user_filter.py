"""SHELL: loads a user's filter class, configured as ``module:Class``, for replays."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import import_module
from os.path import realpath
from pathlib import Path

from fwav_companion.config import Config
from fwav_companion.errors import ConfigError
from fwav_companion.tracking.filters.base import Filter


def load_own_filter(config: Config, *, allow_code: bool, never_from: Iterable[Path]) -> Filter | None:
    """An instance of the configured class; None for a built-in filter. ConfigError if it cannot be loaded.

    A configuration may come from another person together with a recording. Therefore its code runs only with
    ``allow_code``. ``never_from``: the recording's files, from whose folders code is never imported.
    """
    if not config.tracking.is_own_filter:
        return None
    where = f'{config.file}: [tracking] filter = "{config.tracking.filter}"'
    if not allow_code:
        raise ConfigError(f'{where}: this runs Python code; accepted: with --allow-code, or "kalman" | "lowpass"')
    module_name, _, class_name = config.tracking.filter.partition(":")
    _choose_folders({Path(realpath(path)).parent for path in never_from})
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


def _choose_folders(recorded: set[Path]) -> None:
    """Add the working directory to the import path, and remove the folders of a recording from it."""
    here = str(Path.cwd())
    folders = [folder or here for folder in sys.path]
    if here not in folders:
        folders.insert(0, here)
    sys.path[:] = [folder for folder in folders if Path(realpath(folder)) not in recorded]
