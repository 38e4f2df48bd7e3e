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
from ur_cartesian_driver.driver.loop import loop_host
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


def connected() -> LoopConnection:
    """Return an open connection."""
    config = DriverConfig()
    connection = LoopConnection(
        config,
        auto_heartbeat=False,
        on_notification=lambda notification: None,
        on_lost=lambda: None,
        reconfigure=lambda: channel.Configure(config=config, may_upload=False),
    )
    connection.open()
    return connection


def close(connection: LoopConnection, host: Host) -> None:
    """Close a connection, as the robot loop of a host does."""
    closing = threading.Thread(target=connection.close)
    closing.start()
    assert channel.receive(host.loop_end) == channel.Shutdown()
    host.loop_end.close()
    closing.join(5.0)
    assert not connection.is_open


def test_a_loop_that_stops_reading_gets_no_message_after_a_part_of_one(monkeypatch):
    hosts = [Host(), Host()]
    first, second = hosts
    monkeypatch.setattr(loop_host, 'start', lambda _: hosts.pop(0))
    monkeypatch.setattr(loop_connection, 'RESTART_PAUSE', 0.01)
    connection = connected()
    assert isinstance(channel.receive(first.loop_end), channel.Configure)
    first.pipe.settimeout(0.1)
    connection.send_packed([bytes(10_000_000)])
    connection.send(channel.OwnerHeartbeat())
    assert isinstance(channel.receive(second.loop_end), channel.Configure)
    first.loop_end.settimeout(5.0)
    got = 0
    while part := first.loop_end.recv(1 << 20):
        got += len(part)
        assert not part.strip(b'\0'), 'another message'
    assert 0 < got < 10_000_000
    first.loop_end.close()
    close(connection, second)


def test_a_loop_that_cannot_be_restarted_is_tried_again(monkeypatch, caplog):
    hosts = [Host(), None, None, Host()]
    left = list(hosts)

    def start(_):
        if (host := left.pop(0)) is None:
            raise OSError(errno.EAGAIN, 'Resource temporarily unavailable')
        return host

    monkeypatch.setattr(loop_host, 'start', start)
    monkeypatch.setattr(loop_connection, 'RESTART_PAUSE', 0.01)
    connection = connected()
    hosts[0].loop_end.close()
    wait_for(lambda: not left)
    hosts[3].loop_end.settimeout(5.0)
    configured = channel.receive(hosts[3].loop_end)
    assert isinstance(configured, channel.Configure)
    assert not configured.may_upload
    tried = [r for r in caplog.records if 'cannot be restarted' in r.getMessage()]
    assert len(tried) == 2
    close(connection, hosts[3])
