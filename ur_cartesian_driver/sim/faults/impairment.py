# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Holds back the bytes of connections that faults impair; it has no sockets and no clock.

The code that owns a connection (`tcp_server`, `impaired_sockets`) hands the bytes of both
directions to an :class:`ImpairedConnection`, and asks once per cycle for the bytes that are due.
Connections without a fault do not pass through this module. Times are on the controller's clock,
so results are deterministic on the virtual clock.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import Protocol


@dataclass(frozen=True, slots=True, kw_only=True)
class Impairment:
    """The combined faults that affect all connections of an interface."""

    #: Whether messages of the robot are lost.
    drops_outgoing: bool = False
    #: Whether new connections are closed at once.
    refuses_connections: bool = False
    #: Delay in each direction [s].
    delay: float = 0.0
    #: Bound on the rate in each direction [bytes/s].
    rate: float = inf


class Impairable(Protocol):
    """The operations by which faults affect an interface and its connections."""

    def impair(self, impairment: Impairment | None, now: float) -> None:
        """Impair all connections from now on; None = end the impairment."""

    def pump(self, now: float) -> bool:
        """Pass on the bytes that are due; return whether to call again in the next cycle."""

    def drop(self) -> None:
        """Cut all connections."""

    def freeze(self) -> None:
        """Keep the present connections open, but send and receive nothing on them."""

    def inject(self, data: bytes) -> None:
        """Send bytes on all connections."""


class DelayLine:
    """The delayed bytes in one direction of a connection."""

    def __init__(self, now: float) -> None:
        """Begin empty."""
        self._pieces: deque[tuple[float, bytes]] = deque()
        self._budget = 0.0
        self._last = now
        #: Number of bytes that are held back.
        self.size = 0

    def put(self, data: bytes, due: float) -> None:
        """Hold a piece back until it is due; pieces arrive in the order of the calls."""
        if data:
            self._pieces.append((due, data))
            self.size += len(data)

    def clear(self) -> None:
        """Discard the bytes that are held back."""
        self._pieces.clear()
        self.size = 0

    def take(self, now: float, rate: float = inf) -> bytes:
        """
        Return and forget the bytes that are due, as far as the rate allows.

        :param rate: bound on the returned bytes per second; a piece can be returned in parts.
        """
        self._budget = inf if rate == inf else self._budget + rate * (now - self._last)
        self._last = now if now < inf else self._last
        arrived = bytearray()
        while self._pieces and self._pieces[0][0] <= now and self._budget >= 1.0:
            due, data = self._pieces.popleft()
            part = data if len(data) <= self._budget else data[: int(self._budget)]
            if len(part) < len(data):
                self._pieces.appendleft((due, data[len(part) :]))
            self._budget -= len(part)
            arrived += part
        if not self._pieces or self._budget == inf:
            self._budget = 0.0  # an idle line saves nothing for a later burst
        self.size -= len(arrived)
        return bytes(arrived)


class ImpairedConnection:
    """The bytes of a connection that is impaired, or was impaired and still holds bytes back."""

    def __init__(self, impairment: Impairment | None, now: float) -> None:
        """Begin with nothing held back."""
        self.impairment = impairment
        self.frozen = False
        #: Bytes from the peer to the robot; bytes from the robot to the peer.
        self.incoming, self.outgoing = DelayLine(now), DelayLine(now)

    @property
    def is_over(self) -> bool:
        """Whether the connection is sound again and holds nothing back."""
        return self.impairment is None and self.is_drained

    @property
    def is_drained(self) -> bool:
        """Whether no bytes are held back, and the connection is not frozen."""
        return not (self.frozen or self.incoming.size or self.outgoing.size)

    def freeze(self) -> None:
        """Carry no more data, and discard the bytes that are held back."""
        self.frozen = True
        self.incoming.clear()
        self.outgoing.clear()

    def queue_outgoing(self, data: bytes, now: float) -> None:
        """Queue bytes that the robot sends."""
        drops_outgoing = self.impairment is not None and self.impairment.drops_outgoing
        if not self.frozen and not drops_outgoing:
            self.outgoing.put(data, now + self._delay)

    def queue_incoming(self, data: bytes, now: float) -> None:
        """Queue bytes that the peer has sent."""
        if not self.frozen:
            self.incoming.put(data, now + self._delay)

    def due_incoming(self, now: float) -> bytes:
        """Return the bytes that reach the robot now."""
        return self.incoming.take(*self._release_terms(now))

    def due_outgoing(self, now: float) -> bytes:
        """Return the bytes that leave the robot now."""
        return self.outgoing.take(*self._release_terms(now))

    @property
    def _delay(self) -> float:
        return 0.0 if self.impairment is None else self.impairment.delay

    def _release_terms(self, now: float) -> tuple[float, float]:
        """Return the time up to which bytes are due, and their largest rate [bytes/s]."""
        return (inf, inf) if self.impairment is None else (now, self.impairment.rate)
