"""What the daemon frees before it starts."""

import gc
import subprocess
import sys
import weakref

import pytest

from fwav_companion.service.lean import search_for_garbage, without_searches

START = """
import gc, sys
from fwav_companion.service.lean import leave_the_rest_alone, spare_memory
spare_memory()
import fwav_companion.service.daemon
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.scanner import Scanner
frame = Encoder(1, 1).encode("STATUSTEXT", {"severity": 6, "text": "EKF3 ready"})
print(decode(Scanner(datagrams=True).feed(frame)[0]).fields.text)
classes = [each for each in gc.get_objects() if isinstance(each, type)]
print(len(classes) > 500, sum(each.__module__.startswith("pymavlink") for each in classes) < 5, sys.modules["ssl"])
leave_the_rest_alone()
print(gc.isenabled())
"""


def test_messages_are_read_and_written_after_pymavlink_has_been_freed():
    done = subprocess.run([sys.executable, "-c", START], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.splitlines() == ["EKF3 ready", "True True None", "True"]


def test_a_process_that_uses_pymavlink_keeps_it():
    code = (
        "import gc\nfrom pymavlink.dialects.v20 import ardupilotmega as dialect\n"
        "from fwav_companion.service.lean import spare_memory\nspare_memory()\n"
        "print(dialect.MAVLink.__name__, gc.isenabled())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == ["MAVLink", "True"]


def test_garbage_is_searched_for_again_after_a_recording_that_cannot_be_read():
    searched = [gc.isenabled()]

    def read():
        with without_searches():
            searched.append(gc.isenabled())
            raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        read()
    assert [*searched, gc.isenabled()] == [True, False, True]


class Circular:
    """Refers to itself."""

    def __init__(self) -> None:
        self.itself = self


def test_a_circle_is_freed_within_sixteen_seconds():
    gc.disable()
    try:
        gone = weakref.ref(Circular())
        lived = 0
        while gone() is not None and lived < 100:
            lived += 1
            search_for_garbage(1000 + lived)
    finally:
        gc.enable()
    assert 0 < lived <= 16
