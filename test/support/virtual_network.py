# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
An event loop on a clock of its own, with a network in memory.

When nothing is ready, time jumps to the next timer: a test of minutes takes only its computing
time, and runs in the same way each time. The code under test gets its timers, connections and
listening ports from this loop, and does not notice the difference.

Faults of single connections: :meth:`VirtualLoop.cut`, :meth:`~VirtualLoop.freeze` and
:meth:`~VirtualLoop.inject_data`.
"""

import asyncio
from collections import deque
import contextlib
import errno
import selectors

from ur_cartesian_driver.sim.sockets.script_sockets import SocketState

HOST = '127.0.0.1'
_FIRST_FREE_PORT = 40_001
_FIRST_CLIENT_PORT = 60_001


class _SkippingSelector(selectors.DefaultSelector):
    """
    A selector that does not wait, but adds the timeout to the virtual time.

    It never asks the system for events of sockets, because there are none.
    """

    loop: 'VirtualLoop'

    def select(self, timeout=None):
        if timeout is None:
            raise RuntimeError('nothing will ever happen any more')
        self.loop.now += max(timeout, 0.0)
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """The event loop; each test has its own."""

    def __init__(self):
        selector = _SkippingSelector()
        self.now = 0.0
        super().__init__(selector)
        selector.loop = self
        self.servers = {}
        #: Client ends of all connections so far.
        self.ends = []
        #: Ports to which the cable is cut.
        self.unreachable = frozenset()

    def time(self):
        return self.now

    # ---- the interface of asyncio ----------------------------------------------------------

    # The overridden method has a type for each argument of the function.
    def run_in_executor(self, executor, func, *args):  # type: ignore[override]
        """Call the function at once, because a thread knows nothing of the virtual time."""
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # raised where the future is awaited
            future.set_exception(error)
        return future

    async def create_server(self, protocol_factory, host=None, port=None, **_):
        port = port or next(
            free for free in range(_FIRST_FREE_PORT, 65_536) if free not in self.servers
        )
        if port in self.servers:
            raise OSError(errno.EADDRINUSE, 'Address already in use')
        self.servers[port] = _Server(self, protocol_factory, port)
        return self.servers[port]

    async def create_connection(self, protocol_factory, host=None, port=None, **_):
        protocol = protocol_factory()
        transport = self.connect(protocol, port)
        await asyncio.sleep(0)
        return transport, protocol

    def connect(self, protocol, port):
        """
        Connect at once.

        :raises ConnectionRefusedError: nobody listens.
        :raises OSError: the port is unreachable.
        """
        if port in self.unreachable:
            raise OSError(errno.EHOSTUNREACH, 'No route to host')
        if port not in self.servers:
            raise ConnectionRefusedError(errno.ECONNREFUSED, 'Connection refused')
        local = _FIRST_CLIENT_PORT + len(self.ends)
        near = _End(self, protocol, (HOST, local), (HOST, port))
        far = _End(self, self.servers[port].factory(), (HOST, port), (HOST, local))
        near.peer, far.peer = far, near
        self.ends.append(near)
        near.protocol.connection_made(near)
        far.protocol.connection_made(far)
        return near

    # ---- faults of connections ---------------------------------------------------------------

    def open_ends(self, port):
        """Return the client ends of the open connections to a port."""
        return [end for end in self.ends if end.address[1] == port and not end.is_closing()]

    def cut(self, port):
        """Cut all connections to a port; both sides notice."""
        for end in self.open_ends(port):
            end.abort()

    def freeze(self, port):
        """Deliver nothing more on the connections to a port, not even that they close."""
        for end in self.open_ends(port):
            end.frozen = end.peer.frozen = True

    def cut_cable(self, ports):
        """
        Deliver nothing to and from some ports, and refuse new connections to them.

        When the cable to a port is whole again (the port is not in ``ports``), all sent data
        arrive, because TCP repeats them.
        """
        self.unreachable = frozenset(ports)
        for end in self.ends:
            for one in (end, end.peer):
                one.schedule()

    def inject_data(self, port, data):
        """Send data to a port as if its client had sent it."""
        for end in self.open_ends(port):
            end.write(data)


class _Server:
    """A listening port, in place of asyncio.Server."""

    def __init__(self, loop, factory, port):
        self._loop, self.factory, self._port = loop, factory, port
        self.sockets = [_Socket((HOST, port))]

    async def start_serving(self):
        """Do nothing: the server serves already."""

    def close(self):
        if self._loop.servers.get(self._port) is self:
            del self._loop.servers[self._port]

    async def wait_closed(self):
        """Do nothing: the server is closed already."""


class _Socket:
    """The used part of a socket's interface."""

    def __init__(self, name):
        self._name = name

    def getsockname(self):
        return self._name

    def setsockopt(self, *_):
        """Do nothing: there is no delay to be switched off."""


class _End(asyncio.Transport):
    """One end of a connection: data arrive at the peer in the loop's next turn."""

    def __init__(self, loop, protocol, name, address):
        super().__init__({'socket': _Socket(name), 'sockname': name, 'peername': address})
        self.loop, self.protocol, self.address = loop, protocol, address
        self.peer = None
        self.frozen = False
        #: All bytes that have arrived here, for tests.
        self.received = bytearray()
        self._closing = self._paused = self._is_due = False
        self._inbox = deque()

    def get_protocol(self):
        return self.protocol

    def set_protocol(self, protocol):
        self.protocol = protocol

    def is_closing(self):
        return self._closing

    def write(self, data):
        if not self._closing and data:
            self.peer._receive(bytes(data))

    def get_write_buffer_size(self):
        return sum(map(len, self.peer._inbox)) if self.peer._is_held() else 0

    def pause_reading(self):
        self._paused = True

    def resume_reading(self):
        if self._paused:
            self._paused = False
            self.schedule()

    def is_reading(self):
        return not self._paused and not self._closing

    def close(self):
        if not self._closing:
            self._closing = True
            self.loop.call_soon(self.protocol.connection_lost, None)
            self.peer._receive(b'')

    abort = close

    def _receive(self, data):
        """Queue data from the peer; no bytes = the peer has closed."""
        if self.frozen or self._closing:
            return
        self._inbox.append(data)
        self.schedule()

    def _is_held(self):
        ports = self.address[1], self.peer.address[1]
        return self._paused or not self.loop.unreachable.isdisjoint(ports)

    def schedule(self):
        """Deliver the sent data, if they can arrive."""
        if self._inbox and not self._is_due and not self._is_held():
            self._is_due = True
            self.loop.call_soon(self._deliver)

    def _deliver(self):
        self._is_due = False
        while self._inbox and not self._is_held() and not self._closing:
            data = self._inbox.popleft()
            if data:
                self.received += data
                deliver(self.protocol, data)
            elif not self.protocol.eof_received():
                self.close()


def deliver(protocol, data):
    """Deliver data to a protocol, buffered or not."""
    if not isinstance(protocol, asyncio.BufferedProtocol):
        protocol.data_received(data)
        return
    while data:
        buffer = memoryview(protocol.get_buffer(len(data)))
        size = min(len(buffer), len(data))
        buffer[:size] = data[:size]
        protocol.buffer_updated(size)
        data = data[size:]


class _ProgramSocket(asyncio.Protocol):
    """A socket of a robot program; data waits until the program reads it."""

    def __init__(self):
        self.incoming = bytearray()
        self.is_open = True

    def data_received(self, data):
        self.incoming += data

    def connection_lost(self, exc):
        self.is_open = False


class ProgramNetwork:
    """The simulator's ScriptSockets: sockets of robot programs on the loop's network."""

    def __init__(self, loop):
        self._loop = loop
        self._sockets = {}

    def open(self, name, address, port):
        self.close(name)
        protocol = _ProgramSocket()
        with contextlib.suppress(OSError):
            self._sockets[name] = self._loop.connect(protocol, port), protocol

    def state(self, name):
        there = name in self._sockets and self._sockets[name][1].is_open
        return SocketState.OPEN if there else SocketState.CLOSED

    def received(self, name):
        return self._sockets[name][1].incoming if name in self._sockets else bytearray()

    def send(self, name, data):
        if self.state(name) is not SocketState.OPEN:
            return False
        self._sockets[name][0].write(data)
        return True

    def close(self, name):
        if name in self._sockets:
            self._sockets.pop(name)[0].close()

    def close_all(self):
        for name in list(self._sockets):
            self.close(name)

    def poll(self):
        """Do nothing: everything has happened already."""


class LoopClock:
    """The simulator's cycles on the loop's clock."""

    skipped = 0.0

    def __init__(self, loop, cycle):
        self._loop, self._cycle = loop, cycle
        self._due = loop.time()

    async def next_cycle(self):
        self._due += self._cycle
        await asyncio.sleep(max(0.0, self._due - self._loop.time()))
