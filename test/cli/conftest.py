# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
import socket

import pytest


@pytest.fixture
def closed_port():
    """Return a port that refuses connections; nobody else can open it meanwhile."""
    with socket.socket() as bound:
        bound.bind(('127.0.0.1', 0))
        yield bound.getsockname()[1]
