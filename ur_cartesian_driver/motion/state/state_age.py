# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The age of the robot's states when they are read, and its bound.

A link that carries less than the robot sends does not break: packets queue up, arrive as regularly
as before, and are older each time. The same happens to a process that is not given enough time.
So the controller's clock, which stamps each packet, is compared with ours::

    offset = arrival - timestamp            contains the unknown difference of the two clocks
    age    = offset - base                  base: the offset of a state that is not old at all

* The first packet of a connection was sent after we asked for it, so it is about half as old as
  the quickest answer of the handshake took. A new connection has no queue of its own.
* A packet with a smaller offset was faster: it is the new base.
* The base rises by :data:`DRIFT`, because clocks differ and are adjusted, and by nothing else. A
  minimum over a sliding window would forget the fast packets, and with a window of 10 s accept a
  queue that grows by 20 ms in each second. So a queue is hidden only if it grows by less than 1 ms
  in a second, which takes a link that carries all but a thousandth of the data.
* A timestamp that goes back means that the clock was reset; the base is reset with it.
* A controller that stands still (one in a virtual machine, perhaps) loses the time, and all its
  later states seem old: from here that looks the same as a link with a new delay. Therefore a
  connection whose states stay too old is closed after :data:`STALE_TIMEOUT`. The next one has
  nothing queued, and its handshake tells the real delay.
* When this computer stands still with its clock, the offset shrinks, which sets a new base. When
  its clock goes on, the states that waited for us are as old as they seem.

Pure: no socket; the clock comes in.
"""

from __future__ import annotations

from math import inf

#: Largest difference in the speed of both clocks: crystals differ by 1e-4, NTP slews by 5e-4.
DRIFT = 1e-3
#: How long the states of a connection may be too old until it is replaced [s].
STALE_TIMEOUT = 2.0
#: How long states have to be younger than half the bound until they count as fresh again [s].
RECOVERY_TIME = 1.0


class StateAge:
    """The age of each state of one connection."""

    def __init__(self, delay: float) -> None:
        """
        Begin a connection.

        :param delay: how old its first state is [s].
        """
        self._delay = delay
        self._base, self._last_arrival, self._last_timestamp = -inf, 0.0, inf

    def update(self, arrival: float, timestamp: float) -> float:
        """
        Return how old a state is [s].

        :param arrival: when it was read, on our steady clock [s].
        :param timestamp: when it was true, on the controller's [s].
        """
        offset = arrival - timestamp
        if timestamp < self._last_timestamp:
            self._base = offset - self._delay
        else:
            self._base = min(self._base + DRIFT * (arrival - self._last_arrival), offset)
        self._last_arrival, self._last_timestamp = arrival, timestamp
        return offset - self._base


class StaleStates:
    """Whether states are too old, with a hysteresis: a queue that comes and goes is no good."""

    def __init__(self, max_age: float) -> None:
        """
        Begin fresh.

        :param max_age: bound [s]; 0 = states may have any age.
        """
        self._max_age = max_age or inf
        #: The age that was noticed, 0 = states are fresh [s].
        self.age = 0.0
        self._last_old = -inf

    def update(self, age: float, now: float) -> bool:
        """
        Take the age of a state [s].

        :return: whether :attr:`age` has changed: states got too old, twice as old, or fresh.
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
    """Return that a state is too old, and what to do, as a sentence."""
    return (
        f'The newest state of the robot was {age:.3f} s old, max_state_age is {max_age:g} s: '
        'the network or this computer is too slow; take load off it, or lower rtde_frequency.'
    )
