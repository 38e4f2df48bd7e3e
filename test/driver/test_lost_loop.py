# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A robot loop that is lost: its motion ends, and another loop is started."""

import errno
import socket
import threading
from types import SimpleNamespace
from typing import Any

from waiting import wait_for

from ur_cartesian_driver.driver import DriverConfig, loop_connection
from ur_cartesian_driver.driver.ipc import channel
from ur_cartesian_driver.driver.loop_connection import LoopConnection
from ur_cartesian_driver.driver.motion_handle import ActiveMotion
from ur_cartesian_driver.driver.running_motions import RunningMotions
from ur_cartesian_driver.motion.errors import ErrorCode


def test_a_motion_that_starts_while_the_loop_is_lost_ends():
    loop: Any = SimpleNamespace(lock=threading.RLock(), send_packed=lambda parts: None)
    plan: Any = SimpleNamespace(T_flange_tcp=None, offset_band=None, short_report=tuple)
    running, motion = RunningMotions(loop), ActiveMotion(1, plan, None, lambda request: None)
    lost = threading.Thread(target=running.abort, args=('The loop is lost.',))

    def ready_at_the_last_moment() -> str:
        lost.start()
        lost.join(0.05)
        return ''

    running.start(motion, [], ready_at_the_last_moment)
    lost.join()
    assert motion.motion.result(5.0).code is ErrorCode.CONNECTION_LOST
    assert running.handles == []


class Host:
    """A robot loop of which the test holds the other end."""

    memory = None

    def __init__(self) -> None:
        """Begin with a pipe."""
        self.pipe, self.loop_end = socket.socketpair()

    def join(self) -> None:
        """Close the pipe."""
        self.pipe.close()


def test_a_loop_that_cannot_be_restarted_is_tried_again(monkeypatch, caplog):
    hosts = [Host(), None, None, Host()]
    left = list(hosts)

    def start(_):
        if (host := left.pop(0)) is None:
            raise OSError(errno.EAGAIN, 'Resource temporarily unavailable')
        return host

    monkeypatch.setattr(loop_connection.host, 'start', start)
    monkeypatch.setattr(loop_connection, 'RESTART_PAUSE', 0.01)
    config = DriverConfig()
    connection = LoopConnection(
        config,
        auto_heartbeat=False,
        on_notification=lambda notification: None,
        on_lost=lambda: None,
        reconfigure=lambda: channel.Configure(config=config, may_upload=False),
    )
    connection.open()
    hosts[0].loop_end.close()
    wait_for(lambda: not left)
    hosts[3].loop_end.settimeout(5.0)
    configured = channel.receive(hosts[3].loop_end)
    assert isinstance(configured, channel.Configure)
    assert not configured.may_upload
    tried = [r for r in caplog.records if 'cannot be restarted' in r.getMessage()]
    assert len(tried) == 2
    closing = threading.Thread(target=connection.close)
    closing.start()
    assert channel.receive(hosts[3].loop_end) == channel.Shutdown()
    hosts[3].loop_end.close()
    closing.join(5.0)
    assert not connection.is_open
