# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The sockets that programs open, with the faults of connections between them and the program."""

from __future__ import annotations

from ur_cartesian_driver.sim.impairment import Hampered, Impairment
from ur_cartesian_driver.sim.script_sockets import ScriptSockets, SocketState

#: Bytes that are held back before the rest is left to the kernel, and so to the peer.
_MOST_UNHEARD = 65_536


class FaultySockets:
    """
    Other script sockets, which may be impaired; see :class:`~.script_sockets.ScriptSockets`.

    As long as nothing is wrong every call goes straight through.
    """

    def __init__(self, sockets: ScriptSockets) -> None:
        """Take the sockets that really connect."""
        self._sockets = sockets
        self._impairment: Impairment | None = None
        self._now = 0.0
        self._names: set[str] = set()
        self._hampered: dict[str, Hampered] = {}
        self._arrived: dict[str, bytearray] = {}

    def open(self, name: str, address: str, port: int) -> None:
        """Begin to connect, unless a fault keeps the program from it."""
        self.close(name)
        if self._impairment is not None and self._impairment.refusing:
            return
        self._names.add(name)
        if self._impairment is not None:
            self._hamper(name)
        self._sockets.open(name, address, port)

    def state(self, name: str) -> SocketState:
        """Return the state of a name."""
        return self._sockets.state(name)

    def received(self, name: str) -> bytearray:
        """Return what has arrived; what was delayed comes before what was not."""
        if name in self._hampered:
            return self._arrived[name]
        return self._sockets.received(name)

    def send(self, name: str, data: bytes) -> bool:
        """Send; what a fault swallows counts as sent."""
        if name not in self._hampered:
            return self._sockets.send(name, data)
        if self._sockets.state(name) is not SocketState.OPEN:
            return False
        self._hampered[name].say(data, self._now)
        return True

    def close(self, name: str) -> None:
        """Close one."""
        self._names.discard(name)
        self._hampered.pop(name, None)
        self._arrived.pop(name, None)
        self._sockets.close(name)

    def close_all(self) -> None:
        """Close all."""
        self._names.clear()
        self._hampered.clear()
        self._arrived.clear()
        self._sockets.close_all()

    def poll(self) -> None:
        """Go on with connecting and sending."""
        self._sockets.poll()

    # As faults see it: an Impairable

    def impair(self, impairment: Impairment | None, now: float) -> None:
        """Let this be wrong with all sockets."""
        self._impairment, self._now = impairment, now
        for name in self._names:
            self._hamper(name)

    def pump(self, now: float) -> bool:
        """Let go what is due; tell whether this has to be called again in the next cycle."""
        self._now = now
        for name, hampered in tuple(self._hampered.items()):
            self._pump(name, hampered)
        return self._impairment is not None or bool(self._hampered)

    def drop(self) -> None:
        """Cut all sockets; the program finds them closed."""
        self.close_all()

    def freeze(self) -> None:
        """Neither hear nor say anything on the sockets that there are."""
        for name in self._names:
            self._hamper(name).frozen = True

    def inject(self, data: bytes) -> None:
        """Say something that no program has said."""
        for name in self._names:
            self.send(name, data)

    def _hamper(self, name: str) -> Hampered:
        hampered = self._hampered.setdefault(name, Hampered(self._impairment, self._now))
        hampered.impairment = self._impairment
        self._arrived.setdefault(name, bytearray())
        return hampered

    def _pump(self, name: str, hampered: Hampered) -> None:
        arrived = self._arrived[name]
        if hampered.unheard < _MOST_UNHEARD and (incoming := self._sockets.received(name)):
            hampered.hear(bytes(incoming), self._now)
            incoming.clear()
        arrived += hampered.heard(self._now)
        if data := hampered.said(self._now):
            self._sockets.send(name, data)
        if hampered.over and not arrived:
            del self._hampered[name], self._arrived[name]
