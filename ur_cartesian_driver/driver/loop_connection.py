# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The owner's end of a robot loop: starts it, talks to it, replaces it when it dies or hangs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
import logging
import socket
import threading

from ur_cartesian_driver.driver.callbacks import LOG
from ur_cartesian_driver.driver.ipc import channel
from ur_cartesian_driver.driver.ipc.channel import (
    Configure,
    Notification,
    OwnerHeartbeat,
    Request,
    Shutdown,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.loop import loop_host as host
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Pause before a lost robot loop is replaced [s]: the cause may end the next loop, too.
RESTART_PAUSE = 0.5


class LoopConnection:
    """The connection to a robot loop; thread-safe. Callbacks run on its own reader thread."""

    def __init__(
        self,
        config: DriverConfig,
        *,
        auto_heartbeat: bool,
        on_notification: Callable[[Notification | Request], None],
        on_lost: Callable[[], None],
        reconfigure: Callable[[], Configure],
        logger: logging.Logger = LOG,
    ) -> None:
        """
        Keep the callbacks; :meth:`open` starts the loop.

        :param on_lost: called when the loop has died or hangs.
        :param reconfigure: called before another loop starts; returns that loop's configuration.
        """
        self._config, self._auto_heartbeat = config, auto_heartbeat
        self._on_notification, self._on_lost = on_notification, on_lost
        self._reconfigure, self._log = reconfigure, logger
        #: Guards the pipe, opening and closing, and the data of :class:`~.RunningMotions`, which
        #: change with them.
        self.lock = threading.RLock()
        self.host: host.LoopHost | None = None
        self._closed = threading.Event()
        self._threads: list[threading.Thread] = []

    @property
    def is_open(self) -> bool:
        """Return whether the loop runs, or is being replaced."""
        return self.host is not None and not self._closed.is_set()

    @property
    def state(self) -> RobotState | None:
        """The newest robot state; None before the first and while the robot is disconnected."""
        running = self.host
        if running is None or self._closed.is_set():
            return None
        try:
            return running.memory.read()
        except ValueError:  # closed at this moment
            return None

    def open(self) -> None:
        """Start the loop, if it is not running."""
        with self.lock:
            if self.host is not None:
                return
            self._closed.clear()
            self.host = host.start(self._config.robot_loop)
            self.send(Configure(config=self._config))
            self._start_thread('driver reader', self._read)
            if self._auto_heartbeat:
                self._start_thread('driver heartbeat', self._send_heartbeats)

    def close(self) -> bool:
        """End the loop and all threads; return False if the loop was not running."""
        with self.lock:
            if self.host is None or self._closed.is_set():
                return False
            self._closed.set()
            self.send(Shutdown())
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()
        with self.lock:
            self.host.join()
            self.host, self._threads = None, []
        return True

    def send(self, request: Request) -> None:
        """
        Send a request; a lost loop raises no error, because the reader thread replaces it.

        :raises LocalProtocolError: the request cannot be pickled.
        """
        self.send_packed(channel.pack_parts(request))

    def send_packed(self, parts: Sequence[channel.Buffer]) -> None:
        """Send a packed request."""
        with self.lock:
            if self.host is None:
                return
            try:
                for part in parts:
                    self.host.pipe.sendall(part)
            except OSError:
                # No other message may follow a part of this one: the reader starts another loop.
                with contextlib.suppress(OSError):
                    self.host.pipe.shutdown(socket.SHUT_RDWR)

    def _start_thread(self, name: str, target: Callable[[], None]) -> None:
        thread = threading.Thread(target=target, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _send_heartbeats(self) -> None:
        while not self._closed.wait(self._config.node_timeout / 4.0):
            self.send(OwnerHeartbeat())

    def _read(self) -> None:
        heard: host.LoopHost | None = None
        while (running := self.host) is not None:  # None: a callback has closed the connection
            notification = channel.receive(running.pipe)
            if notification is not None:
                if heard is not running:
                    heard = running
                    with contextlib.suppress(OSError):  # the pipe was closed meanwhile
                        running.pipe.settimeout(host.SILENCE_TIMEOUT)
                self._handle(notification)
            elif self._closed.is_set():
                return
            else:
                self._restart()

    def _handle(self, notification: Notification | Request) -> None:
        """Pass a message on; a callback that fails must not end the reader thread."""
        try:
            self._on_notification(notification)
        except Exception:
            self._log.exception(
                'handling a %s of the robot loop failed', type(notification).__name__
            )

    def _restart(self) -> None:
        """
        Replace a robot loop that died or hangs.

        The robot program stops the arm, because its sockets were closed or silent for too long.
        """
        self._log.error('the robot loop ended unexpectedly or hangs; it is restarted')
        self._on_lost()
        while not self._closed.wait(RESTART_PAUSE):
            with self.lock:
                if self.host is None or self._closed.is_set():
                    return
                configure = self._reconfigure()
                self.host.join()
                try:
                    self.host = host.start(self._config.robot_loop)
                except OSError as error:  # no process, memory or file descriptor is left
                    self._log.error('the robot loop cannot be restarted: %s; trying again', error)
                    continue
                self.send(configure)
                return
