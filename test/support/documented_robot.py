# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A server in place of the Robot API, which shares no code with the package.

It is Python's own server, and its answers follow the manufacturer's client library and its tests.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import contextlib
from email.message import Message
import http.server
import json
import threading
from typing import Any, TypeAlias

API = '/universal-robots/robot-api'
NOT_FOUND = (404, {'detail': 'Not Found'})

#: Status, fields or bytes of the body, and headers; or a function of the handler that returns such
#: an answer, or None to hang up.
Answer: TypeAlias = Any


class DocumentedRobot(http.server.ThreadingHTTPServer):
    """
    Gives the prescribed answer to each request, and keeps the requests.

    :param answers: (method, path below API) -> answer, or one answer to all requests.
    """

    daemon_threads = True

    def __init__(self, answers: Mapping[tuple[str, str], Answer] | Answer) -> None:
        super().__init__(('127.0.0.1', 0), _Handler)
        self.answers = dict(answers) if isinstance(answers, Mapping) else answers
        #: Method, path below API and fields of each request; None = the body is no JSON.
        self.requests: list[tuple[str, str, Any]] = []
        #: Headers and body of each request.
        self.contents: list[tuple[Message, bytes]] = []

    def answer_to(self, method: str, path: str) -> Answer:
        """Return the answer to a request."""
        if isinstance(self.answers, dict):
            return self.answers.get((method, path), NOT_FOUND)
        return self.answers


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = 'HTTP/1.1'
    server: DocumentedRobot

    def _serve(self) -> None:
        body = self.rfile.read(int(self.headers.get('Content-Length', '0')))
        path = self.path.removeprefix(API)
        is_json = self.headers.get('Content-Type') == 'application/json'
        fields = json.loads(body) if is_json else None
        self.server.requests.append((self.command, path, fields))
        self.server.contents.append((self.headers, body))
        answer = self.server.answer_to(self.command, path)
        if callable(answer):
            answer = answer(self)
        if answer is None:
            self.close_connection = True
            return
        status, fields, *headers = answer
        data = fields if isinstance(fields, bytes) else json.dumps(fields).encode()
        self.send_response(status)
        self.send_header('Content-Length', str(len(data)))
        for name, value in headers:
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    do_GET = do_PUT = do_POST = do_DELETE = _serve

    def log_message(self, *_: object) -> None:
        """Be quiet."""


@contextlib.contextmanager
def documented_robot(
    answers: Mapping[tuple[str, str], Answer] | Answer,
) -> Iterator[DocumentedRobot]:
    """Serve answers in a thread."""
    with DocumentedRobot(answers) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
