# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
import asyncio
import gc
import sys
import threading
import time

import pytest

from ur_cartesian_driver.sim.programs.compile_thread import CompileThread, SWITCH_INTERVAL


def test_nothing_follows_from_what_is_compiled_when_the_robot_closes():
    begun, go_on = threading.Event(), threading.Event()
    done = []

    def work():
        begun.set()
        assert go_on.wait(10.0)
        done.append('the program under way')

    async def close_meanwhile():
        before = set(threading.enumerate())
        compiler = CompileThread(asyncio.get_running_loop())
        (thread,) = set(threading.enumerate()) - before
        compiler.compile(work, lambda _: done.append('its start'))
        compiler.compile(lambda: done.append('the next program'), done.append)
        assert await asyncio.to_thread(begun.wait, 10.0)
        compiler.close()
        go_on.set()
        thread.join(10.0)
        assert thread.daemon
        assert not thread.is_alive()
        await asyncio.sleep(0)  # runs the calls that the thread has queued in the loop

    asyncio.run(close_meanwhile())
    assert done == ['the program under way']


def test_two_simulators_that_compile_at_once_leave_the_interpreter_as_it_was():
    before = sys.getswitchinterval(), gc.isenabled()
    first_begun, second_begun, first_done = (threading.Event() for _ in range(3))
    seen = []

    def first():
        first_begun.set()
        second_begun.wait()

    def second():
        second_begun.set()
        first_done.wait()
        seen.append((sys.getswitchinterval(), gc.isenabled()))

    async def run():
        compilers = [CompileThread(asyncio.get_running_loop()) for _ in range(2)]
        compilers[0].compile(first, lambda _: first_done.set())
        await asyncio.to_thread(first_begun.wait)
        compilers[1].compile(second, lambda _: None)
        for compiler in compilers:
            await compiler.wait_until_idle()
            compiler.close()

    asyncio.run(run())
    assert seen == [(pytest.approx(SWITCH_INTERVAL), False)]
    for _ in range(1000):  # the threads end their jobs a moment after they told
        if (sys.getswitchinterval(), gc.isenabled()) == before:
            break
        time.sleep(0.001)
    assert (sys.getswitchinterval(), gc.isenabled()) == before
