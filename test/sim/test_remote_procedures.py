# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Remote procedure calls of programs, answered by the XML-RPC server of Python."""

from __future__ import annotations

from collections.abc import Iterator
import threading
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from robot_ports import FREE

from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.programs.program_runner import RUNNING
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.sockets.tcp_script_sockets import TcpScriptSockets


class Camera:
    """A remote object for a program to call; keeps the arguments."""

    def __init__(self) -> None:
        self.seen: list[Any] = []

    def look(self, *arguments: Any) -> Any:
        self.seen.append(arguments)
        return arguments[0]

    def lens(self) -> Any:
        return {'name': 'wide', 'size': [1, 2]}

    def fail(self) -> None:
        raise ValueError('no light')


@pytest.fixture(params=['HTTP/1.0', 'HTTP/1.1'])
def camera(request) -> Iterator[tuple[Camera, int]]:
    """Serve a camera on a free port."""
    camera = Camera()
    with SimpleXMLRPCServer(('127.0.0.1', 0), logRequests=False, allow_none=True) as server:
        handler: Any = server.RequestHandlerClass
        server.RequestHandlerClass = type(
            'Handler', (handler,), {'protocol_version': request.param}
        )
        server.register_function(camera.look, 'scene.look')
        server.register_function(camera.look)
        server.register_function(camera.lens)
        server.register_function(camera.fail)
        thread = threading.Thread(target=server.serve_forever, args=(0.005,))
        thread.start()
        try:
            yield camera, server.server_address[1]
        finally:
            server.shutdown()
            thread.join()


def run(port: int, body: str) -> list[str]:
    """Run a program with a handle `camera` to its end; return its text messages."""
    controller, _ = assemble(SimulatorConfig(**FREE), sockets=TcpScriptSockets())
    address = f'"http://127.0.0.1:{port}/RPC2"'
    controller.programs.submit(
        f'def test():\n  camera = rpc_factory("xmlrpc", {address})\n{body}\nend\n'
    )
    while controller.programs.state in RUNNING:
        controller.step()
    return list(controller.messages.log)


def test_values_of_all_types_go_there_and_back(camera):
    served, port = camera
    log = run(
        port,
        """
  textmsg(camera.look(p[0.1, 0.2, 0.3, 0, 0, 1.5]))
  textmsg(camera.scene.look([1, 2.5, 3], True, "a<b", struct(n=1), [[1, 2], [3, 4]]))
  lens = camera.lens()
  textmsg(lens.name, lens.size[1])
  camera.closeXMLRPCClientConnection()
  textmsg(camera.look(None))
        """,
    )
    assert log == ['p[0.1, 0.2, 0.3, 0, 0, 1.5]', '[1, 2.5, 3]', 'wide2', 'None']
    assert served.seen == [
        ({'x': 0.1, 'y': 0.2, 'z': 0.3, 'rx': 0.0, 'ry': 0.0, 'rz': 1.5},),
        ([1, 2.5, 3], True, 'a<b', {'n': 1}, [[1, 2], [3, 4]]),
        (None,),
    ]


def test_a_call_that_fails_ends_the_program_and_says_why(camera):
    _, port = camera
    for call, reason in (('fail', 'no light'), ('absent', 'is not supported')):
        (error,) = run(port, f'  camera.{call}()\n  textmsg("on")')
        assert (
            f'The remote procedure call {call} of http://127.0.0.1:{port}/RPC2 failed: ' in error
        )
        assert reason in error


def test_a_request_that_is_longer_than_a_socket_keeps_is_sent_in_parts(camera):
    served, port = camera
    log = run(port, '  textmsg(length(camera.look(make_list(3000, 1.5))))')
    assert log == ['3000']
    assert served.seen == [([1.5] * 3000,)]
