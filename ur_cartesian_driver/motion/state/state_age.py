# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The age of the robot's states when they are read, and its bound.

A link that carries less than the robot sends does not break: packets queue up, arrive as regularly
as before, and are older each time. The same happens if a process gets too little computing time.
So the controller's clock, which stamps each packet, is compared with ours::

    offset = arrival - timestamp            contains the unknown difference of the two clocks
    age    = offset - base                  base: the offset of a state of age 0

* The first packet of a connection was sent after we asked for it, and the connection has no queue
  yet. So the age of this packet is about half the shortest round trip of the handshake.
* A packet with a smaller offset was faster: its offset is the new base.
* The base rises at most by :data:`DRIFT` times the elapsed time, because clocks differ and are
  adjusted. (A minimum over a sliding window would forget the fast packets: with a window of 10 s
  it would accept a queue that grows by 20 ms per second.) So only a queue that grows by less than
  1 ms per second stays hidden, on a link that carries all but a thousandth of the data.
* A timestamp that goes back means that the clock was reset; the base is reset with it.
* A controller that freezes for a while (in a virtual machine, perhaps) loses that time, and all
  its later states seem old: the driver cannot tell this from a new delay of the link. Therefore a
  connection whose states stay too old is closed after :data:`STALE_TIMEOUT`. The next one has
  nothing queued, and its handshake measures the real delay.
* If this computer freezes together with its clock, the offset shrinks, which sets a new base. If
  its clock goes on, the states that waited meanwhile are as old as they seem.

This module has neither sockets nor a clock: its callers pass the times.
"""

from __future__ import annotations

from math import inf

#: Largest difference in the speed of both clocks: crystals differ by 1e-4, NTP slews by 5e-4.
DRIFT = 1e-3
#: How long the states of a connection may be too old before it is replaced [s].
STALE_TIMEOUT = 2.0
#: How long states have to be younger than half the bound before they are fresh again [s].
RECOVERY_TIME = 1.0


class StateAge:
    """The age of each state of one connection."""

    def __init__(self, delay: float) -> None:
        """
        Begin a connection.

        :param delay: the age of the connection's first state [s].
        """
        self._delay = delay
        self._base, self._last_arrival, self._last_timestamp = -inf, 0.0, inf

    def update(self, arrival: float, timestamp: float) -> float:
        """
        Return the age of a state [s].

        :param arrival: when the driver read the state, on its steady clock [s].
        :param timestamp: when the controller stamped the state, on its own clock [s].
        """
        offset = arrival - timestamp
        if timestamp < self._last_timestamp:
            self._base = offset - self._delay
        else:
            self._base = min(self._base + DRIFT * (arrival - self._last_arrival), offset)
        self._last_arrival, self._last_timestamp = arrival, timestamp
        return offset - self._base


class StaleStates:
    """Whether states are too old, with hysteresis: a queue that comes and goes is a fault too."""

    def __init__(self, max_age: float) -> None:
        """
        Begin with fresh states.

        :param max_age: largest age that is not too old [s]; 0 = no age is too old.
        """
        self._max_age = max_age or inf
        #: The age at the last change [s]: 0 = states are fresh.
        self.age = 0.0
        self._last_old = -inf

    def update(self, age: float, now: float) -> bool:
        """
        Take the age of a state [s], at the time ``now`` [s].

        :returns: whether :attr:`age` has changed: states became too old, twice as old, or fresh.
        """
        if age > (0.5 * self._max_age if self.age else self._max_age):
            self._last_old = now
            if age > 2.0 * self.age:
                self.age = age
                return True
        elif self.age and now - self._last_old >= RECOVERY_TIME:
            self.age = 0.0
            return True
        return False


def explain_age(age: float, max_age: float) -> str:
    """Return a sentence for the user: the newest state is too old, and what to do about it."""
    return (
        f'The newest state of the robot was {age:.3f} s old, max_state_age is {max_age:g} s: '
        'the network or this computer is too slow; take load off it, or lower rtde_frequency.'
    )
