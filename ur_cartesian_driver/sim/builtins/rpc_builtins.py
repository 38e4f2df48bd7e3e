# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Remote procedure calls of programs: XML-RPC over the sockets that programs use.

A pose is sent as a struct with the members x, y, z, rx, ry and rz, as the manufacturer's example
servers expect. Each call opens its own connection; the program waits for the answer without a time
limit. A call that fails ends the program.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError
import xmlrpc.client

from ur_cartesian_driver.sim.builtins.arguments import text
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.builtins.socket_builtins import CONNECT_TIMEOUT
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.sockets.script_sockets import SocketState
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import (
    make_list,
    make_pose,
    Matrix,
    RemoteObject,
    ScriptPose,
    Struct,
    type_name,
    Value,
)

#: A longer answer [bytes] is treated as an error of the server.
MAX_ANSWER = 1024 * 1024
#: Size of the parts in which a request is sent [bytes]; the socket buffers up to four parts.
MAX_PART = 16_384


class RpcBuiltins(BuiltinGroup):
    """The function that makes remote objects, whose methods a program can call."""

    def rpc_factory(self, type: Value, url: Value) -> RemoteObject:
        """Return an object whose methods call a server; nothing is sent before the first call."""
        if text(type, 'type').lower() != 'xmlrpc':
            raise RuntimeException(f'type is {type!r}; it must be "xmlrpc"')
        return RemoteProcedures(self._controller, text(url, 'url'))


class RemoteProcedures(RemoteObject):
    """The procedures of one server."""

    def __init__(self, controller: Controller, url: str) -> None:
        """
        Parse the address of the server.

        :raises RuntimeException: the URL is not an HTTP address.
        """
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port or 80
        except ValueError:
            parts, host, port = urlsplit(''), None, 0
        if parts.scheme != 'http' or not host:
            raise RuntimeException(f'url is {url!r}; it must be like "http://127.0.0.1:8080/RPC2"')
        self._controller, self._url = controller, url
        self._host, self._port, self._path = host, port, parts.path or '/'
        self._calls = 0

    def call(self, method: str, arguments: Sequence[Value]) -> Generator[None, None, Value]:
        """
        Call a procedure and wait for its answer.

        `closeXMLRPCClientConnection` does nothing, because each call closes its connection.
        """
        if method == 'closeXMLRPCClientConnection':
            return None
        parameters = tuple(_to_wire(argument) for argument in arguments)
        body = xmlrpc.client.dumps(parameters, method, allow_none=True).encode()
        answer = yield from self._post(method, body)
        try:
            found = xmlrpc.client.loads(answer)[0]
        except xmlrpc.client.Fault as fault:
            raise self._failure(method, f'{fault.faultString} ({fault.faultCode})') from None
        except (ExpatError, xmlrpc.client.Error, ValueError, TypeError):
            raise self._failure(method, 'the answer is no XML-RPC') from None
        return _from_wire(found[0]) if found else None

    def _post(self, method: str, body: bytes) -> Generator[None, None, bytes]:
        """Send a request over a new connection; return the body of the answer."""
        sockets, controller = self._controller.sockets, self._controller
        self._calls += 1
        name = f'\0{id(self)} {self._calls}'  # cannot clash with a program's sockets
        sockets.open(name, self._host, self._port)
        try:
            deadline = controller.time + CONNECT_TIMEOUT
            while sockets.state(name) is SocketState.CONNECTING and controller.time < deadline:
                yield
            head = (
                f'POST {self._path} HTTP/1.1\r\nHost: {self._host}:{self._port}\r\n'
                'Content-Type: text/xml\r\nConnection: close\r\n'
                f'Content-Length: {len(body)}\r\n\r\n'
            )
            left = memoryview(head.encode() + body)
            while left:
                if sockets.state(name) is not SocketState.OPEN:
                    raise self._failure(method, 'nothing answers there')
                if sockets.send(name, bytes(left[:MAX_PART])):
                    left = left[MAX_PART:]
                else:  # the server reads slowly
                    yield
            received = bytearray()
            while True:
                closed = sockets.state(name) is not SocketState.OPEN
                arrived = sockets.received(name)
                received += arrived
                arrived.clear()
                answer = self._body(method, bytes(received), closed)
                if answer is not None:
                    return answer
                if closed:
                    raise self._failure(method, 'the connection ended within the answer')
                yield
        finally:
            sockets.close(name)

    def _body(self, method: str, received: bytes, closed: bool) -> bytes | None:
        """
        Return the body of an HTTP answer; None = the answer has not fully arrived.

        :param closed: whether the server has closed the connection.
        :raises RuntimeException: the answer is too long, or reports an error.
        """
        head, separator, body = received.partition(b'\r\n\r\n')
        if len(received) > MAX_ANSWER:
            raise self._failure(method, 'the answer is longer than 1 MiB')
        if not separator:
            return None
        status, *lines = head.decode('latin-1').split('\r\n')
        if status.split(' ')[1:2] != ['200']:
            raise self._failure(method, f'the answer is "{status}"')
        fields = {
            key.strip().lower(): value.strip()
            for key, _, value in (line.partition(':') for line in lines)
        }
        length = fields.get('content-length', '')
        if length.isdecimal():
            return body[: int(length)] if len(body) >= int(length) else None
        return body if closed else None

    def _failure(self, method: str, reason: str) -> RuntimeException:
        return RuntimeException(
            f'The remote procedure call {method} of {self._url} failed: {reason}.'
        )


def _to_wire(value: Value) -> Any:
    if isinstance(value, ScriptPose):
        return value._asdict()
    if isinstance(value, Struct):
        return {name: _to_wire(item) for name, item in value.fields.items()}
    if isinstance(value, Matrix):
        return value.rows
    if isinstance(value, list):
        return [_to_wire(item) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise RuntimeException(f'Type error: a remote procedure takes no {type_name(value)}')


def _from_wire(value: Any) -> Value:
    if isinstance(value, dict):
        if set(value) == set(ScriptPose._fields):
            return make_pose([value[name] for name in ScriptPose._fields])
        return Struct({str(name): _from_wire(item) for name, item in value.items()})
    if isinstance(value, list | tuple):
        return make_list([_from_wire(item) for item in value])
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise RuntimeException(f'Type error: a remote procedure returned a {type(value).__name__}')
