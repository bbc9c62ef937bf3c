"""The daemon ends with exit status 0 on a stop signal, from before its first import to the end of the interpreter."""

import signal
import subprocess
import sys

import pytest

SIGNALS = [signal.SIGTERM, signal.SIGINT, signal.SIGHUP]

AT_THE_FIRST_IMPORT = """
import os, signal, sys

class First:
    def find_spec(self, name, path=None, target=None):
        if not name.startswith("fwav_companion") or name.startswith("fwav_companion.cli"):
            os.kill(os.getpid(), {number})

sys.meta_path.insert(0, First())
sys.argv = ["fwav-companion", "run", "--config", "absent.toml"]
from fwav_companion.__main__ import main
sys.exit(main())
"""

ANOTHER_COMMAND = """
import os, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it

class First:
    def find_spec(self, name, path=None, target=None):
        if name == "fwav_companion.cli.main":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, First())
from fwav_companion.__main__ import main
sys.exit(main(["check"]))
"""

AFTER_THE_LOOP = """
import asyncio, atexit, os, signal, sys

atexit.register(lambda: os.kill(os.getpid(), {number}))
from fwav_companion.service.stop_signals import end_by

async def serve():
    stop = asyncio.Event()
    end_by(asyncio.get_running_loop(), stop.set)
    os.kill(os.getpid(), {number})
    await stop.wait()
    print("stopped", flush=True)

asyncio.run(serve())
"""


def ended(code: str, *, ignored: tuple[int, ...] = ()) -> tuple[int, str]:
    def heeds() -> None:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)

    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, preexec_fn=heeds, check=False
    )
    assert done.stderr == "" or done.returncode == 2
    return done.returncode, done.stdout


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_before_the_first_import_of_the_program_ends_it_cleanly(number: int) -> None:
    assert ended(AT_THE_FIRST_IMPORT.format(number=int(number))) == (0, "")


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_stops_the_loop_and_another_one_at_the_end_changes_nothing(number: int) -> None:
    assert ended(AFTER_THE_LOOP.format(number=int(number))) == (0, "stopped\n")


def test_a_hangup_that_nohup_ignores_remains_ignored() -> None:
    """The configuration is absent: exit 2 shows that the process went on."""
    status, _ = ended(AT_THE_FIRST_IMPORT.format(number=int(signal.SIGHUP)), ignored=(signal.SIGHUP,))
    assert status == 2


def test_ctrl_c_during_the_imports_of_another_command_shows_no_traceback():
    done = subprocess.run([sys.executable, "-c", ANOTHER_COMMAND], capture_output=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, b"")
