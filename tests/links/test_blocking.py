"""Blocking calls in daemon threads: results, errors, and an exit that does not wait for a call that hangs."""

import asyncio
import subprocess
import sys
import threading

import pytest
from link_listening import run, until

from fwav_companion.blocking import in_daemon_thread


def test_result_error_and_thread():
    async def story() -> None:
        assert await in_daemon_thread(threading.current_thread, name="look up x") is not threading.main_thread()
        thread = await in_daemon_thread(threading.current_thread, name="look up x")
        assert (thread.name, thread.daemon) == ("look up x", True)
        with pytest.raises(ZeroDivisionError):
            await in_daemon_thread(lambda: 1 / 0, name="x")

    run(story())


def test_a_result_without_a_waiting_caller_is_undone():
    go_on, undone = threading.Event(), []

    async def story() -> None:
        task = asyncio.create_task(in_daemon_thread(lambda: go_on.wait() and 7, name="x", undo=undone.append))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert undone == []
        go_on.set()
        await until(lambda: undone == [7])

    run(story())


def test_a_result_and_a_cancellation_in_one_turn_of_the_loop():
    undone: list[int] = []

    async def story() -> None:
        task = asyncio.create_task(in_daemon_thread(lambda: 7, name="x", undo=undone.append))
        await asyncio.sleep(0)
        for thread in threading.enumerate():
            if thread.name == "x":
                thread.join()
        await asyncio.sleep(0)  # the result is there, the task has not run
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert undone == [7]

    run(story())


def test_a_result_after_the_loop_has_ended_is_undone():
    go_on, undone = threading.Event(), threading.Event()

    async def story() -> None:
        task = asyncio.create_task(in_daemon_thread(go_on.wait, name="x", undo=lambda _result: undone.set()))
        await asyncio.sleep(0)
        task.cancel()

    run(story())
    go_on.set()
    assert undone.wait(20)


def test_a_call_that_hangs_holds_up_no_exit():
    code = """
import asyncio, threading
from fwav_companion.blocking import in_daemon_thread

async def main():
    try:
        async with asyncio.timeout(0.01):
            await in_daemon_thread(threading.Event().wait, name="hangs")
    except TimeoutError:
        print("left behind")

asyncio.run(main())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (0, "left behind\n", "")
