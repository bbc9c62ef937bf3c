"""``fwav-companion run``: runs the daemon."""

from __future__ import annotations

import argparse
import logging
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from argparse import _SubParsersAction


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "run",
        description="Runs until SIGTERM, SIGINT or SIGHUP. A link or address that does not exist yet is retried.",
        epilog="example:\n  fwav-companion run --config fwav-companion.toml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--config", metavar="FILE", required=True, help="the configuration, as `init` writes one")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Check the configuration and its files, then serve."""
    from fwav_companion.service.lean import allow_openssl, leave_the_rest_alone, spare_memory

    spare_memory()  # before anything large is imported
    from fwav_companion.config import load, load_signing_key

    config = load(arguments.config)
    if config.map_server is not None and config.map_server.may_use_tls:
        allow_openssl()
    import asyncio

    from fwav_companion.service.configured_files import load_calibration, load_elevation, recorded_extra_files
    from fwav_companion.service.daemon import Service

    config.require_links()
    calibration = load_calibration(config) if config.localizes else None
    key = load_signing_key(config)
    elevation = load_elevation(config) if config.localizes else ()
    extra_files = recorded_extra_files(config)
    logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(levelname)s %(message)s")

    async def serve() -> None:
        service = Service(config, calibration, key, elevation=elevation, extra_files=extra_files)
        leave_the_rest_alone()
        await service.run()

    asyncio.run(serve())
    return 0
