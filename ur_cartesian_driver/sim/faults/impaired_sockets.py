# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The sockets that programs open, with connection faults between the sockets and the programs."""

from __future__ import annotations

from ur_cartesian_driver.sim.faults.impairment import ImpairedConnection, Impairment
from ur_cartesian_driver.sim.sockets.script_sockets import ScriptSockets, SocketState

#: While this many received bytes are held back, no more are read; they wait in the kernel.
_MAX_INCOMING = 65_536


class ImpairedSockets:
    """
    Script sockets that faults can impair.

    They wrap :class:`~ur_cartesian_driver.sim.sockets.script_sockets.ScriptSockets`; without a
    fault, every call is passed on to the wrapped sockets.
    """

    def __init__(self, sockets: ScriptSockets) -> None:
        """Wrap the sockets that make the connections."""
        self._sockets = sockets
        self._impairment: Impairment | None = None
        self._now = 0.0
        self._names: set[str] = set()
        self._impaired: dict[str, ImpairedConnection] = {}
        self._arrived: dict[str, bytearray] = {}

    def open(self, name: str, address: str, port: int) -> None:
        """Begin to connect, unless a fault refuses connections."""
        self.close(name)
        if self._impairment is not None and self._impairment.refuses_connections:
            return
        self._names.add(name)
        if self._impairment is not None:
            self._impair_socket(name)
        self._sockets.open(name, address, port)

    def state(self, name: str) -> SocketState:
        """Return the state; a socket that its peer closed is OPEN while bytes are held back."""
        state = self._sockets.state(name)
        impaired = self._impaired.get(name)
        if impaired is None or state is not SocketState.CLOSED or name not in self._names:
            return state
        is_held = bool(impaired.incoming.size or self._sockets.received(name))
        return SocketState.OPEN if is_held else state

    def received(self, name: str) -> bytearray:
        """Return the unread bytes; delayed bytes come before newer ones."""
        if name in self._impaired:
            return self._arrived[name]
        return self._sockets.received(name)

    def send(self, name: str, data: bytes) -> bool:
        """Send data; bytes that a fault drops are reported as sent."""
        if name not in self._impaired:
            return self._sockets.send(name, data)
        if self._sockets.state(name) is not SocketState.OPEN:
            return False
        self._impaired[name].queue_outgoing(data, self._now)
        return True

    def close(self, name: str) -> None:
        """Close a socket."""
        self._names.discard(name)
        self._impaired.pop(name, None)
        self._arrived.pop(name, None)
        self._sockets.close(name)

    def close_all(self) -> None:
        """Close all sockets."""
        self._names.clear()
        self._impaired.clear()
        self._arrived.clear()
        self._sockets.close_all()

    def poll(self) -> None:
        """Continue connecting and sending."""
        self._sockets.poll()

    # The interface for faults: an Impairable

    def impair(self, impairment: Impairment | None, now: float) -> None:
        """Impair all sockets from now on; None = end the impairment."""
        self._impairment, self._now = impairment, now
        for name in self._names:
            self._impair_socket(name)

    def pump(self, now: float) -> bool:
        """Pass on the bytes that are due; return whether to call again in the next cycle."""
        self._now = now
        for name, impaired in tuple(self._impaired.items()):
            self._pump(name, impaired)
        return self._impairment is not None or bool(self._impaired)

    def drop(self) -> None:
        """Cut all sockets; the program finds them closed."""
        self.close_all()

    def freeze(self) -> None:
        """Keep the present sockets open, but send and receive nothing on them."""
        for name in self._names:
            self._impair_socket(name).freeze()

    def inject(self, data: bytes) -> None:
        """Send bytes that no program has sent, to the peers of all sockets."""
        for name in self._names:
            self.send(name, data)

    def _impair_socket(self, name: str) -> ImpairedConnection:
        impaired = self._impaired.setdefault(name, ImpairedConnection(self._impairment, self._now))
        impaired.impairment = self._impairment
        self._arrived.setdefault(name, bytearray())
        return impaired

    def _pump(self, name: str, impaired: ImpairedConnection) -> None:
        arrived = self._arrived[name]
        if impaired.incoming.size < _MAX_INCOMING and (incoming := self._sockets.received(name)):
            impaired.queue_incoming(bytes(incoming), self._now)
            incoming.clear()
        arrived += impaired.due_incoming(self._now)
        if data := impaired.due_outgoing(self._now):
            self._sockets.send(name, data)
        if impaired.is_over and not arrived:
            del self._impaired[name], self._arrived[name]
