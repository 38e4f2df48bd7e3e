# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
import asyncio
import threading

from ur_cartesian_driver.sim.programs.compile_thread import CompileThread


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
        await asyncio.sleep(0)  # what the thread has asked the loop to call

    asyncio.run(close_meanwhile())
    assert done == ['the program under way']
