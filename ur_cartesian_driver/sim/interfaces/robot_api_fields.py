# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The fields of requests to the Robot API, its refusals, and answers that wait."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from email.parser import BytesParser
from email.policy import HTTP
from http import HTTPStatus
import json
from typing import Any

from ur_cartesian_driver.sim.controller import Controller

#: Fields of a request; the fields of a form are bytes.
Body = Mapping[str, Any]
#: Fields of an answer.
Fields = Mapping[str, Any]


class Refused(Exception):
    """Raised for a request that is not carried out."""

    def __init__(self, status: HTTPStatus, message: str, **fields: Any) -> None:
        """Take the HTTP status and the fields of the answer."""
        super().__init__(message)
        self.status, self.fields = status, {'message': message, **fields}


@dataclass(frozen=True, slots=True)
class Waiting:
    """A request that is answered later: when the robot has carried it out, or cannot do so."""

    #: Returns whether the request is carried out; raises `Refused` if it has failed.
    is_done: Callable[[Controller], bool]
    #: The message of the answer to a request that was carried out.
    message: str


def read_body(data: bytes, content_type: str) -> Body:
    """
    Return the fields of a request, which is a form with files or a JSON object.

    :raises ValueError: the body is neither.
    """
    if content_type.startswith('multipart/form-data'):
        head = f'Content-Type: {content_type}\r\n\r\n'.encode()
        form = BytesParser(policy=HTTP).parsebytes(head + data)
        return {
            str(part.get_param('name', header='content-disposition')): part.get_payload(
                decode=True
            )
            for part in form.iter_parts()
        }
    fields = json.loads(data or b'{}')
    if not isinstance(fields, dict):
        raise ValueError('no object')
    return fields


def text_field(body: Body, field: str) -> str:
    """
    Return the text in a field of a request.

    :raises ValueError: the field is missing, or not a text.
    """
    value = body.get(field)
    if not isinstance(value, str):
        raise ValueError(f'{field} is {value!r}')
    return value
