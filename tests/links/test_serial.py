"""Serial links over pseudo-terminals, the far end in the test's hands."""

import asyncio
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from link_listening import PATIENCE_S, Listener, run, started, until

from fwav_companion.errors import LinkError
from fwav_companion.links import serial as serial_links
from fwav_companion.links.reconnect import StayingConnected
from fwav_companion.links.serial import SerialOpener, UsbIdentity, find_and_open
from fwav_companion.links.url import SerialUrl


class Port(NamedTuple):
    """A port as pyserial lists it."""

    device: str
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


class Terminal:
    """A pseudo-terminal: ``path`` is the device, ``fd`` the far end."""

    def __init__(self) -> None:
        self.fd, device = os.openpty()
        self.path = os.ttyname(device)
        self._device = device

    def unplug(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
            os.close(self._device)
            self.fd = -1

    async def read(self, size: int) -> bytes:
        def read() -> bytes:
            data = b""
            while len(data) < size:
                data += os.read(self.fd, size - len(data))
            return data

        async with asyncio.timeout(PATIENCE_S):
            return await asyncio.to_thread(read)


@pytest.fixture(name="terminal")
def _terminal() -> Iterator[Terminal]:
    terminal = Terminal()
    yield terminal
    terminal.unplug()


def nothing_listed() -> Sequence[Port]:
    return ()


def serial_link(url: SerialUrl, listener: Listener, list_all: Callable[[], Sequence[Port]]) -> StayingConnected:
    return StayingConnected("a", SerialOpener(url, list_all), listener.on_bytes, listener.on_state)


def test_both_ways_and_every_byte(terminal: Terminal):
    every = bytes(range(256))

    async def story() -> None:
        listener = Listener()
        with started(f"serial://{terminal.path}:921600", listener) as link:
            await listener.until_up()
            link.send(every)
            assert await terminal.read(256) == every
            os.write(terminal.fd, every)
            await listener.until(lambda: len(listener.data) == 256)
            assert listener.data == every
            assert link.status().device == terminal.path

    run(story())


def test_unplugged_and_back_behind_the_same_path(tmp_path: Path):
    async def story() -> None:
        listener, by_id, first, second = Listener(), tmp_path / "by-id", Terminal(), Terminal()
        by_id.symlink_to(first.path)
        with started(f"serial://{by_id}:57600", listener) as link:
            await listener.until_up()
            by_id.unlink()
            first.unplug()
            await listener.until_down()
            by_id.symlink_to(second.path)
            await listener.until_up(times=2)
            link.send(b"again")
            assert await second.read(5) == b"again"
        assert [up for up, _ in listener.states] == [True, False, True]
        second.unplug()

    run(story())


def test_a_usb_device_is_found_by_its_ids_under_any_name():
    async def story() -> None:
        listener, first, second = Listener(), Terminal(), Terminal()
        ports = [Port("/dev/ttyS0"), Port(first.path, 0x1209, 0x5741, "A1")]
        link = serial_link(SerialUrl(vendor_id=0x1209, product_id=0x5741, baud=115200), listener, lambda: ports)
        link.start()
        await listener.until_up()
        ports[1:] = [Port("/dev/ttyOther", 0x1209, 0x9999), Port(second.path, 0x1209, 0x5741, "A1")]
        first.unplug()
        await listener.until_up(times=2)
        assert link.status().device == second.path
        link.close()
        second.unplug()

    run(story())


def test_a_path_that_is_gone_is_found_by_the_identity_it_had(tmp_path: Path):
    async def story() -> None:
        listener, path, first, second = Listener(), tmp_path / "ttyACM0", Terminal(), Terminal()
        path.symlink_to(first.path)
        ports = [Port(first.path, 0x26AC, 0x11, "0"), Port("/dev/ttyOther", 0x26AC, 0x11, "1")]
        link = serial_link(SerialUrl(device=str(path), baud=115200), listener, lambda: ports)
        link.start()
        await listener.until_up()
        path.unlink()
        ports[0] = Port(second.path, 0x26AC, 0x11, "0")
        first.unplug()
        await listener.until_up(times=2)
        assert link.status().device == second.path
        link.close()
        second.unplug()

    run(story())


def test_of_several_ports_with_the_ids_the_first_is_taken(terminal: Terminal):
    ports = [Port(f"{terminal.path}0", 1, 2), Port(terminal.path, 1, 2), Port("/dev/pts/999999", 1, 2)]
    opened = find_and_open(SerialUrl(vendor_id=1, product_id=2, baud=9600), None, lambda: ports)
    opened.port.close()
    assert opened.device == terminal.path
    assert opened.identity == UsbIdentity(1, 2, "")


@pytest.mark.parametrize(
    ("url", "said"),
    [
        (SerialUrl(device="/dev/nothing-here", baud=9600), "/dev/nothing-here: no such device"),
        (SerialUrl(vendor_id=0x1209, product_id=0x5741, baud=9600), "USB device 1209:5741: no such device"),
        (SerialUrl(device="/dev/null", baud=9600), "/dev/null: not a serial port"),
    ],
)
def test_what_is_no_device(url: SerialUrl, said: str):
    with pytest.raises(LinkError) as caught:
        find_and_open(url, None, nothing_listed)
    assert str(caught.value).startswith(said)


def test_a_port_that_another_program_has(terminal: Terminal):
    code = (
        "import serial, sys\n"
        f"port = serial.Serial({terminal.path!r}, exclusive=True)\n"
        "print(1, flush=True)\n"
        "sys.stdin.read()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"1\n"
        with pytest.raises(LinkError, match=f"{terminal.path}: in use by another program"):
            find_and_open(SerialUrl(device=terminal.path, baud=9600), None, nothing_listed)
        other.communicate()


def test_a_line_that_takes_nothing_costs_the_oldest_and_cuts_no_frame(terminal: Terminal):
    async def story() -> None:
        listener = Listener()
        with started(f"serial://{terminal.path}:57600", listener) as link:
            await listener.until_up()
            for i in range(5000):
                link.send(i.to_bytes(4, "big") * 25)
            dropped = int(link.status().dropped)
            assert dropped > 0
            data = await terminal.read((5000 - dropped) * 100)
        frames = [data[at : at + 100] for at in range(0, len(data), 100)]
        assert all(frame == frame[:4] * 25 for frame in frames)
        numbers = [int.from_bytes(frame[:4], "big") for frame in frames]
        assert numbers == sorted(numbers)
        assert numbers[-1] == 4999

    run(story())


def test_on_a_line_that_others_fill_the_services_own_messages_leave_first_and_whole(terminal: Terminal):
    """Twenty times what the line takes is forwarded, as by a stranger on a station's link."""

    async def story() -> None:
        listener = Listener()
        with started(f"serial://{terminal.path}:57600", listener) as link:
            await listener.until_up()
            for i in range(1000):
                link.send(b"f" * 200, origin=("ground", ""))
                if i % 50 == 49:
                    link.send(b"own" + bytes((i // 50,)))
            data = await terminal.read(200 * (1000 - int(link.status().dropped)) + 20 * 4)
        last_own = data.index(b"own\x13")
        assert [data[at + 3] for at in range(len(data)) if data[at : at + 3] == b"own"] == list(range(20))
        assert last_own < len(data) - 2000, "they left behind the waiting frames"
        assert len(data.replace(b"f" * 200, b"")) == 80, "a frame was cut"

    run(story())


def test_a_burst_that_the_line_begins_delays_the_services_own_messages_by_one_frame(terminal: Terminal):
    """A read of a station's link is 32 kB: all its frames used to leave in one piece, for six seconds at 57600 baud."""

    async def story() -> None:
        listener = Listener()
        heartbeat = bytes.fromhex("fd 09 00 00 00 ff be 00 00 00 00 00 00 00 06 08 00 04 03 00 00")
        with started(f"serial://{terminal.path}:57600", listener) as link:
            await listener.until_up()
            link.send(heartbeat * 5000, origin=("ground", ""))
            link.send(b"own")
            begun = link.status().bytes_out
            left = begun + 2000
            data = await terminal.read(left)
        assert begun <= data.index(b"own") < begun + 21
        assert data.replace(b"own", b"") == (heartbeat * 5000)[: left - 3], "a frame was cut"

    run(story())


def test_an_open_that_hangs_holds_up_nothing_and_its_late_port_is_closed(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
):
    hanging, calls = threading.Event(), []
    real = serial_links.find_and_open

    def hangs(*arguments: object) -> object:
        calls.append(real(*arguments))
        hanging.wait()
        return calls[-1]

    monkeypatch.setattr(serial_links, "find_and_open", hangs)
    monkeypatch.setattr(serial_links, "OPEN_WAIT_S", 0.02)

    pauses: list[float] = []

    async def pause(seconds: float) -> None:
        pauses.append(seconds)
        await asyncio.sleep(0)

    async def story() -> None:
        listener = Listener()
        opener = SerialOpener(SerialUrl(device=terminal.path, baud=57600), nothing_listed)
        link = StayingConnected("a", opener, listener.on_bytes, listener.on_state, sleep=pause)
        link.start()
        await until(lambda: len(pauses) >= 2)
        link.close()
        assert len(calls) == 1, "the second try waits for the same thread"
        assert listener.states == [(False, "the device does not open within 0.02 s")]
        hanging.set()
        await until(lambda: not calls[0].port.is_open)

    run(story())
