"""What is imported before the daemon handles stop signals: nothing else. The benchmark of the start has its time."""

import subprocess
import sys

MODULES_BEFORE = """
import signal, sys
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored, and then left alone
before = set(sys.modules)
sys.argv = ["fwav-companion", "run", "--config", "absent.toml"]

def install(number, handler, installed=signal.signal):
    installed(number, handler)
    if number == signal.SIGHUP:
        print(*sorted(set(sys.modules) - before))
        sys.exit(0)

signal.signal = install
from fwav_companion.__main__ import main
main()
"""


def test_nothing_but_the_handlers_own_modules_comes_first():
    done = subprocess.run([sys.executable, "-c", MODULES_BEFORE], capture_output=True, text=True, check=True)
    assert {name for name in done.stdout.split() if name.startswith("fwav_companion")} == {
        "fwav_companion",
        "fwav_companion.__main__",
        "fwav_companion.service",
        "fwav_companion.service.stop_signals",
    }
    assert len(done.stdout.split()) == 4, "another library came first"
