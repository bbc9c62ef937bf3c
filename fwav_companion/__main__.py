"""``python -m fwav_companion`` and the console script."""

import sys


def main(argv: "Sequence[str] | None" = None) -> int:
    """Run the command line. The daemon's signals are handled before any other module is imported."""
    if argv is None and sys.argv[1:2] == ["run"]:
        from fwav_companion.service.stop_signals import end_at_once

        end_at_once()
    try:
        from fwav_companion.cli.main import main as run_command_line
    except KeyboardInterrupt:  # in the first tenth of a second
        return 130  # EXIT_INTERRUPTED of the module that is not there
    return run_command_line(argv)


TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

if __name__ == "__main__":
    sys.exit(main())
